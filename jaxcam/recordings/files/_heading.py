"""Parse the heading of a column: its name, followed by the unit in brackets."""

import re

from .._units import ending_of


_WITH_UNIT = re.compile(
    r"(.+?)\s*(?:\(([^()]*)\)|\[([^\[\]]*)\]|/\s*([^\s/]+(?:/s(?:\^?.)?)?))"
)


def channel_name(heading: str, unit: str = "") -> str:
    """Return the channel name, which ends with the unit: `time_s` for `Time (s)`.

    A heading with an unknown unit is unchanged.

    **Arguments:** the heading, and its cell in a line of units.
    """
    words = heading
    if not unit:
        found = _WITH_UNIT.fullmatch(heading)
        if found is None:
            return heading
        words, unit = found[1], next((part for part in found.groups()[1:] if part), "")
    ending = ending_of(unit)
    name = re.sub(r"\W+", "_", words).strip("_")
    if not ending or not name:
        return heading
    return f"{name.lower()}_{ending}"


def is_unit(cell: str) -> bool:
    """Return whether a cell may be part of a line of units."""
    return cell in ("", "-", "1") or bool(ending_of(cell))


def is_time(heading: str) -> bool:
    """Return whether a heading denotes the time, according to its first word."""
    return bool(re.match(r"(time|t|zeit|frame)([^a-z]|$)", heading.lower()))
