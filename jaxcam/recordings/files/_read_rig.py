"""Reading a rig's file: every number with its unit, every mistake by its name."""

import dataclasses
import difflib
import tomllib
from pathlib import Path
from typing import Any

from .._errors import RigError
from .._rig import Gyro, Quantity, References, Rig, Sensors


# bytes of a file; a rig takes two thousand
_LARGEST = 1_000_000

# of a quantity in SI units, so that products of several are numbers
_LARGEST_NUMBER = 1e30


def read_rig(file: str | Path) -> Rig:
    """The rig described in a TOML file.

    A quantity is `{value = 0.045, tolerance = 0.002, unit = "m"}` or a bare number;
    `unit` may be left out, and is refused where it is not the SI unit.

    **Raises:** `RigError`, one sentence that names the file and the key.
    """
    file = Path(file)
    tables = _tables(file)
    known = ("geometry", "dynamics", "impact", "sensors", "references")
    _known(file, "", tables, known)
    geometry = _Section(file, "geometry", tables)
    dynamics = _Section(file, "dynamics", tables)
    impact = _Section(file, "impact", tables)
    center_x, center_y = geometry.pair("cam_center", "m")
    rig = Rig(
        cam_radius=geometry.quantity("cam_radius", "m"),
        cam_eccentricity=geometry.quantity("cam_eccentricity", "m"),
        cam_center_x=center_x,
        cam_center_y=center_y,
        follower_half_height=geometry.quantity("follower_half_height", "m"),
        cam_rotation=geometry.choice("cam_rotation", "clockwise", "counterclockwise"),
        inertia=dynamics.quantity("inertia", "kg m^2"),
        spring_stiffness=dynamics.quantity("spring_stiffness", "N/m"),
        spring_hook_x=dynamics.quantity("spring_hook_x", "m"),
        spring_elongation=dynamics.quantity("spring_elongation", "m"),
        restitution=impact.quantity("restitution", ""),
        sensors=_sensors(_Section(file, "sensors", tables)),
        references=_references(file, tables),
    )
    for section in (geometry, dynamics, impact):
        section.done()
    try:
        rig.system(speed=10.0).check()
    except ValueError as error:
        raise RigError(f"{file}: {error}") from None
    return rig


def _tables(file: Path) -> dict[str, Any]:
    """What is in the file, not looked at."""
    if not file.is_file():
        raise RigError(f"{file}: there is no such file; give the path of a rig.toml.")
    with file.open("rb") as stream:
        raw = stream.read(_LARGEST + 1)
    if len(raw) > _LARGEST:
        raise RigError(f"{file}: this is too large for a rig; give a rig.toml.")
    try:
        return tomllib.loads(raw.decode("utf-8-sig"))
    except RecursionError:
        raise RigError(f"{file}: brackets are nested too deep; remove them.") from None
    except ValueError as error:
        # the TOML, its encoding, or an integer of thousands of digits
        raise RigError(f"{file}: this is not a TOML file: {error}.") from None


def _sensors(section: "_Section") -> Sensors:
    gyro = None
    if "gyro" in section.table:
        inner = _Section(section.file, "gyro", section.table)
        names = [field.name for field in dataclasses.fields(Gyro)]
        gyro = Gyro(**{name: inner.positive(name, "") for name in names})
        inner.done()
        section.read.append("gyro")
    sensors = Sensors(
        sample_rate=section.positive("sample_rate", "Hz"),
        cam_counts_per_turn=section.count("cam_counts_per_turn"),
        follower_counts_per_turn=section.count("follower_counts_per_turn"),
        cam_noise=section.positive("cam_noise", "rad"),
        follower_noise=section.positive("follower_noise", "rad"),
        gyro=gyro,
    )
    section.done()
    return sensors


def _references(file: Path, tables: dict[str, Any]) -> References:
    """Constants of forms; those that the file leaves out are the defaults."""
    if "references" not in tables:
        return References()
    section = _Section(file, "references", tables)
    names = [field.name for field in dataclasses.fields(References)]
    _known(file, "references", section.table, names)
    found = {}
    for name in section.table:
        if name.endswith("_speed"):
            found[name] = section.positive(name, "rad/s")
        else:
            found[name] = section.quantity(name, "rad").value
    return References(**found)


class _Section:
    """One table of the file, which remembers the keys that were asked for."""

    def __init__(self, file: Path, name: str, tables: dict[str, Any]):
        if not isinstance(tables.get(name), dict):
            raise RigError(f"{file}: the table [{name}] is missing; add it.")
        self.file, self.name, self.table = file, name, tables[name]
        self.read: list[str] = []

    def quantity(self, key: str, unit: str) -> Quantity:
        value, tolerance = self._parts(key, unit)
        return Quantity(self._number(key, value), self._tolerance(key, tolerance))

    def pair(self, key: str, unit: str) -> tuple[Quantity, Quantity]:
        value, tolerance = self._parts(key, unit)
        tolerance = [0.0, 0.0] if tolerance is None else tolerance
        for part in (value, tolerance):
            if not isinstance(part, list) or len(part) != 2:
                raise self._error(key, "needs two numbers, [x, y]")
        first, second = (
            Quantity(self._number(key, v), self._tolerance(key, t))
            for v, t in zip(value, tolerance)
        )
        return first, second

    def positive(self, key: str, unit: str) -> float:
        number = self.quantity(key, unit).value
        if number <= 0:
            raise self._error(key, f"is {number:g}, and must be positive")
        return number

    def count(self, key: str) -> int:
        number = self.positive(key, "")
        if number != int(number):
            raise self._error(key, f"is {number:g}, and must be a whole number")
        return int(number)

    def choice(self, key: str, *choices: str) -> str:
        value, _ = self._parts(key, "")
        if value not in choices:
            quoted = " or ".join(f'"{choice}"' for choice in choices)
            raise self._error(key, f"is {_short(value)}, and must be {quoted}")
        return value

    def done(self) -> None:
        _known(self.file, self.name, self.table, self.read)

    def _parts(self, key: str, unit: str) -> tuple[Any, Any]:
        self.read.append(key)
        if key not in self.table:
            # a misspelt key is the usual reason, so look at what is there
            found = difflib.get_close_matches(key, self.table, n=1)
            hint = f"; is `{found[0]}` meant?" if found else "; add it."
            raise RigError(f"{self.file}: [{self.name}] has no `{key}`{hint}")
        entry = self.table[key]
        if not isinstance(entry, dict):
            return entry, None
        if "value" not in entry:
            raise self._error(key, "has no `value`")
        place = f"{self.name}.{key}"
        _known(self.file, place, entry, ("value", "tolerance", "unit"))
        if entry.get("unit", unit) != unit:
            found = _short(entry["unit"])
            raise self._error(key, f'is given in {found}, and "{unit}" is used')
        return entry["value"], entry.get("tolerance")

    def _number(self, key: str, value: Any) -> float:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not abs(value) < _LARGEST_NUMBER:
            raise self._error(key, f"is {_short(value)}, and must be a number in SI")
        return float(value)

    def _tolerance(self, key: str, value: Any) -> float:
        tolerance = 0.0 if value is None else self._number(key, value)
        if tolerance < 0:
            raise self._error(key, f"has the tolerance {tolerance:g}, below zero")
        return tolerance

    def _error(self, key: str, what: str) -> RigError:
        return RigError(f"{self.file}: `{key}` in [{self.name}] {what}; correct it.")


def _known(file: Path, place: str, table: dict[str, Any], names) -> None:
    for key in table:
        if key not in names:
            where = f"[{place}]" if place else "a rig file"
            found = difflib.get_close_matches(key, names, n=1)
            hint = f"is `{found[0]}` meant?" if found else "remove it."
            word = _short(key).strip("'\"")
            raise RigError(f"{file}: {where} has an unknown key `{word}`; {hint}")


def _short(value: Any) -> str:
    """A value of the file in a sentence."""
    # of an integer of thousands of digits Python makes no text
    huge = isinstance(value, int) and abs(value) > _LARGEST_NUMBER
    text = "a huge integer" if huge else repr(value)
    text = text.replace("'", '"') if isinstance(value, str) else text
    return text if len(text) <= 40 else f"{text[:40]}..."
