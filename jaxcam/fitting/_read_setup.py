"""Read the rig file of a user's system."""

from collections.abc import Iterator
from pathlib import Path

from ..hybrid import HybridSystem
from ..parameters import parameter_names
from ..recordings import RigError
from ..recordings.files import (
    known_keys,
    LAYOUT_KEYS,
    read_layout,
    read_references,
    read_tables,
    Section,
)
from ._read_channels import channel_of, read_sensors
from ._setup import Setup
from ._stated import check_unit, NUMBER, Stated, stated
from .engine import Input, INTERPOLATIONS, Model, Turning
from .own_systems import Field, stated_system, system_class


_TABLES = (
    "system",
    "parameters",
    "channels",
    "drive",
    "input",
    "references",
    "records",
    "start",
    *LAYOUT_KEYS,
)


def read_setup(
    path: str | Path, system: str | type[HybridSystem] | None = None
) -> Setup:
    """Read a rig file (TOML) of a system of your own.

    `system` in the rig file, such as `"two_stops.py:TwoStops"`, names a Python file
    next to it and a class. The Python file is executed, so read only rig files that you
    trust.

    Args:
        path: The file.
        system: System to use instead of the one in the file: a class, or
            `FILE.py:CLASS` relative to the working directory.

    Returns:
        A [`jaxcam.fitting.Setup`][].

    Raises:
        RigError: The file cannot be used; the message names the file, the key and the
            fix.

    Examples:
        >>> from jaxcam.data import NEW_RIG
        >>> from jaxcam.fitting import read_setup
        >>> setup = read_setup(NEW_RIG / "cart.toml")
        >>> len(setup.channels) > 0
        True
    """
    file = Path(path)
    tables = read_tables(file)
    known_keys(file, "", tables, _TABLES)
    cls = _class(file, tables, system)
    given = dict(_parameters(file, tables))
    fitted = {name: one for name, one in given.items() if one.tolerance > 0}
    drive, drive_channel, measured = _drive(file, tables)
    for name in measured:
        if name in fitted and name != _phase_of(drive):
            raise RigError(
                f"{file}: `{name}` in [parameters] has a tolerance, but a channel "
                "gives its value; remove the tolerance."
            )
    made = stated_system(
        file,
        cls,
        {name: one.value for name, one in given.items()},
        fitted=fitted,
        measured=measured,
    )
    sensors, calibrated = read_sensors(file, tables, made)
    own = (one.parameter(n, Field(f"system.{n}")) for n, one in fitted.items())
    return Setup(
        Model(made, sensors, drive),
        (*own, *calibrated),
        drive_channel,
        read_references(file, tables, None),
        _records(file, tables, made, {*fitted, *measured}),
        read_layout(file, tables),
        {name: one.unit for name, one in given.items() if one.unit},
        _start(file, tables, made),
    )


def is_setup(path: str | Path) -> bool:
    """Return whether a rig file is for `read_setup` and not for a cam-follower.

    Args:
        path: The file.

    Returns:
        True if the file is for `read_setup`.

    Raises:
        RigError: The file is not TOML.

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.fitting import is_setup
        >>> is_setup(DEMO_RIG / "rig.toml")
        False
    """
    return not {"system", "parameters", "channels"}.isdisjoint(read_tables(Path(path)))


def _class(file: Path, tables, system) -> type[HybridSystem]:
    if isinstance(system, type):
        return system
    if system is not None:
        return system_class(system)
    named = tables.get("system")
    if not isinstance(named, str) or not named.strip():
        raise RigError(
            f"{file}: the file does not name a system; begin it with "
            f'system = "FILE.py:CLASS".'
        )
    return system_class(named, file.parent)


def _parameters(file: Path, tables) -> Iterator[tuple[str, Stated]]:
    """Read the entries of `[parameters]`; fields of a part of the system have dotted
    names.
    """
    if "parameters" not in tables:
        return
    section = Section(file, "parameters", tables)
    seen = set()
    for name, inner, key in _flat(section, ""):
        if name in seen:
            raise section.error(name, "is given twice")
        seen.add(name)
        yield name, stated(inner, key)


def _flat(section: Section, before: str) -> Iterator[tuple[str, Section, str]]:
    for key, entry in section.table.items():
        name = f"{before}{key}"
        if isinstance(entry, dict) and entry and set(entry).isdisjoint(NUMBER):
            inner = Section(section.file, key, section.table, section.name)
            yield from _flat(inner, f"{name}.")
        else:
            yield name, section, key


def _start(file: Path, tables, system: HybridSystem) -> tuple[float, ...]:
    """Read the initial state; empty if there is none."""
    if "start" not in tables:
        return ()
    row, names = tables["start"], system.state_names
    section = Section(file, "start", {"start": {}})
    if not isinstance(row, list) or len(row) != (len(names) or len(row)):
        wanted = f"[{', '.join(names)}]" if names else "a list of numbers"
        raise RigError(f"{file}: `start` must be {wanted}, in SI units; correct it.")
    return tuple(section.as_number("start", value) for value in row)


def _records(
    file: Path, tables, system: HybridSystem, taken: set[str]
) -> dict[str, dict[str, float]]:
    """Read the constants of recordings, keyed by patterns of recording names.

    **Arguments:** `taken` contains the names of fields that are fitted or follow a
    measured channel.
    """
    if "records" not in tables:
        return {}
    outer = Section(file, "records", tables)
    known = parameter_names(system)
    found = {}
    for pattern in outer.table:
        section = Section(file, pattern, outer.table, outer.name)
        known_keys(file, section.name, dict(_entries(section)), known)
        values = {}
        for name, inner, key in _flat(section, ""):
            if name in taken:
                raise inner.error(
                    name,
                    "is fitted or measured; remove it from [records]",
                )
            known_value, entry = inner.quantity(key, None), inner.table[key]
            if isinstance(entry, dict):
                check_unit(inner, key, str(entry.get("unit", "")), entry)
            if known_value.tolerance > 0:
                raise inner.error(
                    name,
                    "has a tolerance, but the values in [records] are known; to fit "
                    "a value of its own for each recording, state the tolerance in "
                    f"[parameters], with per_record = true, and remove `{name}` here",
                )
            values[name] = known_value.value
        found[pattern] = values
    return found


def _entries(section: Section) -> Iterator[tuple[str, None]]:
    return ((name, None) for name, _, _ in _flat(section, ""))


def _phase_of(drive: Turning | Input | None) -> str | None:
    """Return the name of the phase field of a rotating drive; the field is the offset
    of the drive angle from the encoder reading.
    """
    if not isinstance(drive, Turning):
        return None
    assert isinstance(drive.phase, Field)
    return drive.phase.name


def _drive(
    file: Path, tables
) -> tuple[Turning | Input | None, str | None, dict[str, float]]:
    """Return the drive, the channel of its encoder if it rotates, and default values of
    the fields of the system that it controls.
    """
    if "drive" in tables and "input" in tables:
        raise RigError(
            f"{file}: it contains both [drive] and [input]; remove the one that the "
            f"system does not have."
        )
    if "drive" in tables:
        section = Section(file, "drive", tables)
        channel = channel_of(section, section.word("channel"))
        speed, phase = (
            section.word(key) if key in section.table else key
            for key in ("speed", "phase")
        )
        measured, acceleration = {phase: 0.0, speed: 1.0}, None
        if "acceleration" in section.table:
            name = section.word("acceleration")
            measured[name], acceleration = 0.0, Field(name)
        known = ("channel", "speed", "phase", "acceleration")
        known_keys(file, "drive", section.table, known)
        drive = Turning(Field(speed), Field(phase), acceleration)
        return drive, channel, measured
    if "input" in tables:
        section = Section(file, "input", tables)
        channel = channel_of(section, section.word("channel"))
        field, between = section.word("field"), INTERPOLATIONS[0]
        if "interpolation" in section.table:
            between = section.choice("interpolation", *INTERPOLATIONS)
        known = ("channel", "field", "interpolation")
        known_keys(file, "input", section.table, known)
        return Input(channel, Field(field), between), None, {field: 0.0}
    return None, None, {}
