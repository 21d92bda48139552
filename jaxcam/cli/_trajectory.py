"""A trajectory as tables, a sentence, plain data and figures."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from ..hybrid import Trajectory
from ..hybrid.record import automaton
from ..models import CamFollower, rad_s_to_rpm
from ._parameters import parameters


# number of rows shown at either end of a table
_ENDS = 6
# maximum number of periods drawn in a time history, and in a phase portrait
_HISTORY, _PORTRAIT = 6.0, 40.0


def impact_table(trajectory: Trajectory) -> Table | None:
    """Tabulate the first and the last impacts; return None if there are no impacts."""
    impacts, system = trajectory.impacts, trajectory.system
    time = np.asarray(impacts.time)
    if not len(time):
        return None
    name, unit = (*system.state_names, "state")[0], (*system.state_units, "")[0]
    second = _unit(system)
    rate = f"{unit}/{second}" if second else unit
    headings = ["", _heading("time", second)]
    period = _period(system)
    if period is not None:
        headings.append(_heading("phase", "rad"))
    headings += [_heading(name, unit)]
    headings += [_heading(which, rate) for which in ("approach", "rebound")]
    several = bool(np.any(impacts.constraint))
    headings += ["constraint"] if several else []
    table = Table(title="Impacts")
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    before, after = np.abs(impacts.speed_before), np.abs(impacts.speed_after)
    for k in _shown(len(time)):
        if k is None:
            table.add_row("…")
            continue
        row = [str(k + 1), f"{time[k]:.8f}"]
        if period is not None:
            row.append(f"{_phase(time[k], period):.5f}")
        row += [f"{float(impacts.before[k, 0]):z.6f}"]
        row += [f"{before[k]:.4e}", f"{after[k]:.4e}"]
        hit = system.constraint_name(int(impacts.constraint[k]))
        table.add_row(*row, *([hit] if several else []))
    return table


def contact_table(trajectory: Trajectory) -> Table | None:
    """Tabulate the first and the last contacts; return None if there are none."""
    contacts, system = trajectory.contacts, trajectory.system
    start, end = np.asarray(contacts.start), np.asarray(contacts.end)
    if not len(start):
        return None
    unit = _unit(system)
    table = Table(title="Contacts")
    table.add_column("", justify="right", no_wrap=True)
    for heading in ("from", "to", "duration"):
        table.add_column(_heading(heading, unit), justify="right", no_wrap=True)
    table.add_column("ended by")
    for k in _shown(len(start)):
        if k is None:
            table.add_row("…")
            continue
        why = "release" if bool(contacts.released[k]) else "end of simulation"
        length = f"{end[k] - start[k]:.8f}"
        table.add_row(str(k + 1), f"{start[k]:.8f}", f"{end[k]:.8f}", length, why)
    return table


def summary(name: str, trajectory: Trajectory) -> str:
    """Summarise the motion in one sentence."""
    system, unit = trajectory.system, _unit(trajectory.system)
    reached = float(trajectory.steps.time[-1])
    at = ""
    if isinstance(getattr(system, "base", system), CamFollower):
        speed = system.speed  # pyright: ignore
        at = f" at {float(rad_s_to_rpm(speed)):.6g} rpm"
    counts = [
        _counted(int(trajectory.impacts.count), "impact"),
        _counted(int(trajectory.contacts.count), "contact"),
    ]
    if trajectory.switches is not None:
        counts.append(_counted(int(trajectory.switches.count), "switching event"))
    # a run from the release point begins there, slightly before t0
    began = float(trajectory.steps.time[0])
    span = f"from {began:.6g} to {reached:.6g}{unit and f' {unit}'}"
    kept = bool(np.any(trajectory.steps.contact[-1]))
    last = "in contact" if kept else "in flight"
    if automaton(system) is not None:
        mode = f"in mode {trajectory.modes.names()[-1]}"
        free = not trajectory.steps.contact.shape[1]
        last = mode if free else f"{last} and {mode}"
    stopped = "" if bool(trajectory.successful) else "stopped early, "
    return f"{name}{at}, {span}: {', '.join(counts)}; {stopped}{last} at the end."


def about(trajectory: Trajectory) -> dict[str, Any]:
    """Return all data of the trajectory in SI units."""
    system, impacts = trajectory.system, trajectory.impacts
    contacts = trajectory.contacts
    return {
        "parameters": parameters(system),
        "state_names": list(system.state_names),
        "state_units": list(system.state_units),
        "constraint_names": list(system.constraint_names),
        "t0": float(trajectory.t0),
        "t1": float(trajectory.t1),
        "tolerance": float(trajectory.settings.tolerance),
        "successful": bool(trajectory.successful),
        "result": trajectory.result,
        "impacts": {
            "count": int(impacts.count),
            "time": impacts.time,
            "before": impacts.before,
            "after": impacts.after,
            "constraint": impacts.constraint,
            "speed_before": impacts.speed_before,
            "speed_after": impacts.speed_after,
        },
        "contacts": {
            "count": int(contacts.count),
            "start": contacts.start,
            "end": contacts.end,
            "released": contacts.released,
            "constraint": contacts.constraint,
        },
        **_switching(trajectory),
        "final": {"time": trajectory.steps.time[-1], "state": trajectory.final},
    }


def _switching(trajectory: Trajectory) -> dict[str, Any]:
    """Return the events at switching surfaces, and the modes, if there are any."""
    switches, found = trajectory.switches, {}
    if switches is not None:
        found["switches"] = {
            "count": int(switches.count),
            "time": switches.time,
            "before": switches.before,
            "after": switches.after,
            "surface": switches.surface,
            "direction": switches.direction,
            "kind": switches.kind,
        }
    if automaton(trajectory.system) is not None:
        modes = trajectory.modes
        found["modes"] = {
            "name": modes.names(),
            "start": modes.start,
            "end": modes.end,
        }
    return found


def draw(trajectory: Trajectory, folder: Path) -> list[Path]:
    """Draw time history, phase portrait and impact map to files in a folder."""
    import matplotlib

    matplotlib.use("Agg")
    from .. import plotting

    history = plotting.time_history(trajectory, between=last(trajectory, _HISTORY))
    portrait = plotting.phase_portrait(trajectory, between=last(trajectory, _PORTRAIT))
    figures = {"time_history": history, "phase_portrait": portrait}
    if int(trajectory.impacts.count) > 1:
        figures["impact_map"] = plotting.impact_return_map(trajectory)
    return [
        plotting.save_figure(figure, folder / f"{name}.png")  # pyright: ignore
        for name, figure in figures.items()
    ]


def last(trajectory: Trajectory, periods: float) -> tuple[float, float] | None:
    """Return the time span of the last `periods`; None if the run is hardly longer."""
    period = trajectory.system.period
    if period is None:
        return None
    start, stop = float(trajectory.t0), float(trajectory.steps.time[-1])
    length = periods * float(period)
    return None if stop - start <= 1.5 * length else (stop - length, stop)


def span_of_history(trajectory: Trajectory) -> str:
    """Return a sentence that states which part of the motion the time history shows.

    The sentence is empty if the time history shows the entire motion.
    """
    if last(trajectory, _HISTORY) is None:
        return ""
    return f"The time history shows the last {_HISTORY:g} forcing periods."


def _shown(number: int) -> list[int | None]:
    if number <= 2 * _ENDS + 1:
        return list(range(number))
    return [*range(_ENDS), None, *range(number - _ENDS, number)]


def _period(system) -> float | None:
    """Return the forcing period; None without forcing, or if its amplitude is zero."""
    if system.period is None or float(getattr(system, "amplitude", 1.0)) == 0:
        return None
    return float(system.period)


def _heading(name: str, unit: str) -> str:
    return f"{name}\n({unit})" if unit not in ("", "-") else name


def _phase(time: float, period: float) -> float:
    return 2 * math.pi * ((time / period) % 1.0)


def _unit(system) -> str:
    """Return the unit of time; empty for a system with dimensionless states only."""
    units = system.state_units
    return "" if units and all(unit == "-" for unit in units) else "s"


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
