"""Read a number of a rig file, with its tolerance and bounds."""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple

from ..recordings.files import known_keys, printable, Section, shown_value, si_of
from .engine import Parameter


NUMBER = ("value", "tolerance", "lower", "upper", "unit", "per_record")
"""Keys that a number with a tolerance may have."""


class Stated(NamedTuple):
    """A value of a rig file; without a tolerance, it is held fixed."""

    value: float | bool | str
    tolerance: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf
    unit: str = ""
    per_record: bool = False

    def parameter(self, name: str, where: Callable, unit: str = "") -> Parameter:
        """Return the parameter of a fit, with the `unit` if the file gives none."""
        return Parameter(
            name,
            where,
            self.tolerance,
            lower=self.lower,
            upper=self.upper,
            per_record=self.per_record,
            unit=self.unit or unit,
        )


def stated(section: Section, key: str) -> Stated:
    """Read one entry: a number, a flag or a word, or a table with `NUMBER` keys."""
    entry = section.table[key]
    if isinstance(entry, bool | str):
        return Stated(entry)
    if not isinstance(entry, dict):
        return Stated(section.as_number(key, entry))
    known_keys(section.file, f"{section.name}.{printable(key)}", entry, NUMBER)
    if "value" not in entry:
        raise section.error(key, "has no `value`")
    value = section.as_number(key, entry["value"])
    lower, upper = (
        section.as_number(key, entry[which]) if which in entry else otherwise
        for which, otherwise in (("lower", -math.inf), ("upper", math.inf))
    )
    if not lower <= value <= upper or lower == upper:
        raise section.error(
            key, f"is {value:g}, and must be between {lower:g} and {upper:g}"
        )
    tolerance = entry.get("tolerance", 0.0)
    if tolerance != math.inf:
        tolerance = section.as_number(key, tolerance)
    if tolerance < 0:
        raise section.error(key, f"has the negative tolerance {tolerance:g}")
    unit = entry.get("unit", "")
    if not isinstance(unit, str):
        raise section.error(key, f"has the unit {shown_value(unit)}, which is not text")
    check_unit(section, key, unit, entry)
    own = entry.get("per_record", False)
    if not isinstance(own, bool):
        raise section.error(
            key, f"has per_record = {shown_value(own)}, and must have true or false"
        )
    if own and not tolerance:
        raise section.error(
            key,
            "has per_record = true but no tolerance; give the tolerance within which "
            "each recording has a value of its own, or give known values under "
            "[records]",
        )
    return Stated(value, float(tolerance), lower, upper, unit, own)


def check_unit(section: Section, key: str, unit: str, entry: Mapping) -> None:
    """Refuse units other than those of SI, to which all channels are converted.

    **Raises:** `RigError` with the numbers of the entry in SI units.
    """
    found = si_of(unit)
    if found is None:
        return
    better, factor = found
    fix = "use units such as m, s, rad and N"
    if better:
        numbers = [
            f"{name} = {float(entry[name]) * factor:.6g}"
            for name in ("value", "tolerance", "lower", "upper")
            if name in entry
        ]
        fix = f'use {", ".join(numbers)}, unit = "{better}"'
    what = f'is given in "{unit}", but all channels are converted to SI units'
    raise section.error(key, what, fix)
