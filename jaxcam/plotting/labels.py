"""Axis labels, with the name and unit of each quantity of a system."""

from ..hybrid import HybridSystem
from ..tables import scaled as scaled


def labelled(name: str, unit: str) -> str:
    """Return `name (unit)`; a dimensionless quantity has the unit `-`, and a quantity
    whose unit is unknown has an empty one.

    Args:
        name: Name of the quantity.
        unit: Its unit.

    Returns:
        The label.

    Examples:
        >>> from jaxcam.plotting.labels import labelled
        >>> labelled("speed", "rad/s"), labelled("ratio", "-"), labelled("reading", "")
        ('speed (rad/s)', 'ratio (–)', 'reading')
    """
    if not unit:
        return name
    # use a dash, because a hyphen in parentheses is easily overlooked
    return f"{name} ({'–' if unit == '-' else unit})"


def state_label(system: HybridSystem, component: int) -> str:
    """Return the label of one component of the state."""
    names, units = system.state_names, system.state_units
    name = names[component] if component < len(names) else f"$x_{{{component + 1}}}$"
    unit = units[component] if component < len(units) else "-"
    return labelled(name, unit)


def gap_unit(system: HybridSystem) -> str:
    """Return the unit of the gap: `gap_unit` of the system, or that of its first state.

    A system whose gap is not in the unit of its first state declares
    `gap_unit: ClassVar[str] = "m"`.
    """
    units = system.state_units
    return getattr(system, "gap_unit", "") or (units[0] if units else "-")


def gap_label(system: HybridSystem) -> str:
    return labelled("gap", gap_unit(system))


def time_unit(system: HybridSystem) -> str:
    """Return s, or - for a system with only dimensionless states."""
    units = system.state_units
    return "-" if units and all(unit in ("-", "") for unit in units) else "s"


def time_label(system: HybridSystem) -> str:
    return labelled("time", time_unit(system))


def speed_unit(system: HybridSystem) -> str:
    """Return the unit of the normal velocity, the rate of change of the gap."""
    unit, time = gap_unit(system), time_unit(system)
    if time == "-":
        return unit
    return f"1/{time}" if unit in ("-", "") else f"{unit}/{time}"
