"""Read tables of a TOML file, with units and precise error messages."""

import difflib
import tomllib
from pathlib import Path
from typing import Any

from .._errors import RigError
from .._rig import Quantity


# maximum size in bytes; a rig file has about two thousand
_LARGEST = 1_000_000

# largest quantity in SI units, so that products stay finite
_LARGEST_NUMBER = 1e30

# maximum number of characters of a text repeated in messages
_LONGEST = 200


def read_tables(file: Path) -> dict[str, Any]:
    """Return the tables of the file, unchecked."""
    if not file.is_file():
        raise RigError(f"{file}: there is no such file; give the path of a rig.toml.")
    with file.open("rb") as stream:
        raw = stream.read(_LARGEST + 1)
    if len(raw) > _LARGEST:
        raise RigError(f"{file}: this is too large for a rig file; give a rig.toml.")
    try:
        return tomllib.loads(raw.decode("utf-8-sig"))
    except RecursionError:
        raise RigError(
            f"{file}: brackets are nested too deeply; remove them."
        ) from None
    except ValueError as error:
        # invalid TOML, a wrong encoding, or an integer of thousands of digits
        raise RigError(f"{file}: this is not a TOML file: {error}.") from None


class Section:
    """One table of the file, which records the keys that were read.

    `within` is the name of the enclosing table.
    """

    def __init__(self, file: Path, name: str, tables: dict[str, Any], within: str = ""):
        self.file, self.table = file, tables.get(name, {})
        self.name = f"{within}.{printable(name)}".lstrip(".")
        self.read: list[str] = []
        if name not in tables or not isinstance(self.table, dict):
            raise RigError(f"{file}: the table [{self.name}] is missing; add it.")

    def quantity(self, key: str, unit: str | None) -> Quantity:
        """Return a number with its tolerance; a unit of `None` allows any unit."""
        value, tolerance = self._parts(key, unit)
        return Quantity(self.as_number(key, value), self._tolerance(key, tolerance))

    def pair(self, key: str, unit: str) -> tuple[Quantity, Quantity]:
        value, tolerance = self._parts(key, unit)
        tolerance = [0.0, 0.0] if tolerance is None else tolerance
        for part in (value, tolerance):
            if not isinstance(part, list) or len(part) != 2:
                raise self.error(key, "needs two numbers, [x, y]")
        first, second = (
            Quantity(self.as_number(key, v), self._tolerance(key, t))
            for v, t in zip(value, tolerance)
        )
        return first, second

    def positive(self, key: str, unit: str | None) -> float:
        number = self.quantity(key, unit).value
        if number <= 0:
            raise self.error(key, f"is {number:g}, but must be positive")
        return number

    def count(self, key: str) -> int:
        number = self.positive(key, "")
        if number != int(number):
            raise self.error(key, f"is {number:g}, but must be a whole number")
        return int(number)

    def choice(self, key: str, *choices: str) -> str:
        value, _ = self._parts(key, "")
        if value not in choices:
            quoted = " or ".join(f'"{choice}"' for choice in choices)
            raise self.error(key, f"is {shown_value(value)}, but must be {quoted}")
        return value

    def done(self) -> None:
        """Raise `RigError` for an unknown key."""
        known_keys(self.file, self.name, self.table, self.read)

    def word(self, key: str) -> str:
        value, _ = self._parts(key, "")
        if not isinstance(value, str) or not value.strip():
            raise self.error(key, f"is {shown_value(value)}, but must be a word")
        return value

    def _parts(self, key: str, unit: str | None) -> tuple[Any, Any]:
        self.read.append(key)
        if key not in self.table:
            # the key is probably misspelt, so a similar one is suggested
            found = difflib.get_close_matches(key, self.table, n=1)
            hint = f"; rename `{found[0]}`." if found else "; add it."
            raise RigError(f"{self.file}: [{self.name}] has no `{key}`{hint}")
        entry = self.table[key]
        if not isinstance(entry, dict):
            return entry, None
        if "value" not in entry:
            raise self.error(key, "has no `value`")
        place = f"{self.name}.{key}"
        known_keys(self.file, place, entry, ("value", "tolerance", "unit"))
        if unit is not None and entry.get("unit", unit) != unit:
            found = shown_value(entry["unit"])
            raise self.error(key, f'is given in {found}, but must be in "{unit}"')
        return entry["value"], entry.get("tolerance")

    def as_number(self, key: str, value: Any) -> float:
        """Return a value as a number. **Raises:** `RigError` if it is not a valid
        number.
        """
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not abs(value) < _LARGEST_NUMBER:
            raise self.error(
                key, f"is {shown_value(value)}, but must be a number in SI"
            )
        return float(value)

    def _tolerance(self, key: str, value: Any) -> float:
        tolerance = 0.0 if value is None else self.as_number(key, value)
        if tolerance < 0:
            raise self.error(key, f"has the negative tolerance {tolerance:g}")
        return tolerance

    def error(self, key: str, what: str, fix: str = "correct it") -> RigError:
        """Return an error to be raised that describes what is wrong with a key."""
        name = printable(key)
        return RigError(f"{self.file}: `{name}` in [{self.name}] {what}; {fix}.")


def known_keys(file: Path, place: str, table: dict[str, Any], names) -> None:
    for key in table:
        if key not in names:
            where = f"[{place}]" if place else "a rig file"
            found = difflib.get_close_matches(key, names, n=1)
            hint = f"is `{found[0]}` meant?" if found else "remove it."
            raise RigError(
                f"{file}: {where} has an unknown key `{printable(key)}`; {hint}"
            )


def printable(text: str) -> str:
    """Return text from a file for use in a sentence: printable, shortened and on one
    line.
    """
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}..."


def shown_value(value: Any) -> str:
    """Return a value from the file for use in a sentence."""
    # Python does not convert an integer of thousands of digits to text
    huge = isinstance(value, int) and abs(value) > _LARGEST_NUMBER
    text = "a huge integer" if huge else repr(value)
    text = text.replace("'", '"') if isinstance(value, str) else text
    return text if len(text) <= 40 else f"{text[:40]}..."
