"""Read the sensors of a rig file."""

import dataclasses
from pathlib import Path

from ..hybrid import HybridSystem, SwitchedSystem
from ..recordings import RigError
from ..recordings.files import known_keys, printable, Section, si, unit_of
from ._stated import Stated, stated
from .engine import Model, Output, Parameter, Sensor


_CALIBRATION = ("gain", "offset", "lag")
_RATE = "rate of "


@dataclasses.dataclass(frozen=True)
class SensorField:
    """Selects the gain, offset or lag of a sensor of a model.

    Two fields of the same names are equal and have the same hash, so problems of the
    same rig share compiled programs.
    """

    channel: str
    """Channel of the sensor."""
    name: str
    """`"gain"`, `"offset"` or `"lag"`."""

    def __call__(self, model: Model):
        return getattr(model.sensors[self.channel], self.name)


def read_sensors(
    file: Path, tables, system: HybridSystem
) -> tuple[dict[str, Sensor], list[Parameter]]:
    """Create a sensor for each table of `[channels]`, and a parameter for each gain,
    offset or lag with a tolerance.
    """
    outer = Section(file, "channels", tables)
    if not outer.table:
        raise RigError(
            f"{file}: [channels] is empty; add a table for each measured channel, "
            f"such as [channels.position_m]."
        )
    sensors, parameters = {}, []
    for name in outer.table:
        channel = channel_of(outer, name)
        sensors[channel], fitted = _sensor(outer, name, system)
        parameters += fitted
    return sensors, parameters


def _sensor(
    outer: Section, name: str, system: HybridSystem
) -> tuple[Sensor, list[Parameter]]:
    if not isinstance(outer.table[name], dict):
        raise outer.error(name, "is not a table with `sees` and `noise`")
    section = Section(outer.file, name, outer.table, outer.name)
    if set(section.table) <= {"noise"}:
        raise RigError(
            f"{outer.file}: [channels.{printable(name)}] has no `sees`; add it, or "
            "remove the table if this is the channel of [drive] or [input]."
        )
    observe = _observed(section, system)
    unit = unit_of(name) or None
    noise = section.positive("noise", unit)
    units = {"resolution": unit, "limit": unit, "bandwidth_hz": "Hz", "tails": ""}
    options = {
        key: section.positive(key, units[key]) for key in units if key in section.table
    }
    calibrated = {
        key: stated(section, key) for key in _CALIBRATION if key in section.table
    }
    keys = ("sees", "noise", *units, *_CALIBRATION)
    known_keys(section.file, section.name, section.table, keys)
    _check(section, calibrated)
    values = {key: one.value for key, one in calibrated.items()}
    sensor = Sensor(observe, noise, **options, **values)  # pyright: ignore
    own_units = {"gain": "", "offset": unit or "", "lag": "s"}
    parameters = [
        one.parameter(f"{name}.{key}", SensorField(name, key), own_units[key])
        for key, one in calibrated.items()
        if one.tolerance > 0
    ]
    return sensor, parameters


def _observed(section: Section, system: HybridSystem) -> int | Output:
    """Return the state component that a channel measures, or the output."""
    seen, names = section.word("sees"), system.state_names
    if seen in names:
        return names.index(seen)
    if seen.removeprefix(_RATE) in names:
        return Output(names.index(seen.removeprefix(_RATE)))
    own = getattr(type(system), seen, None)
    if callable(own) and not hasattr(SwitchedSystem, seen):
        return Output(seen)
    quoted = " or ".join(f'"{name}"' for name in names)
    raise section.error(
        "sees",
        f'is "{printable(seen)}", but must be {quoted}; or "{_RATE}{names[-1]}", as an '
        f"accelerometer sees; or the name of a method `(t, state, rate)` of "
        f"{type(system).__name__}",
    )


def _check(section: Section, calibrated: dict[str, Stated]) -> None:
    for key, one in calibrated.items():
        if isinstance(one.value, bool | str):
            raise section.error(key, "is not a number")
    if "lag" in calibrated and float(calibrated["lag"].value) < 0:
        raise section.error(
            "lag", "is negative; a channel cannot show a motion before it occurs"
        )
    if "gain" in calibrated and float(calibrated["gain"].value) == 0:
        raise section.error("gain", "is zero; such a channel shows nothing")


def channel_of(section: Section, name: str) -> str:
    """Return the name of a channel, which is read in SI units.

    **Raises:** `RigError` if the name ends in another unit.
    """
    renamed, factor = si(name)
    if renamed != name or factor != 1.0:
        raise section.error(
            name,
            f"is read in SI units; call it `{renamed}` and give its noise in SI units",
        )
    return name
