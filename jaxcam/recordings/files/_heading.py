"""Parse the heading of a column: its name, followed by the unit in brackets."""

import re


# unit as written -> end of a channel name
_ENDINGS = {
    "s": "s",
    "sec": "s",
    "ms": "ms",
    "us": "us",
    "µs": "us",
    "rad": "rad",
    "deg": "deg",
    "°": "deg",
    "rpm": "rpm",
    "rad/s": "rad_s",
    "deg/s": "deg_s",
    "°/s": "deg_s",
    "m": "m",
    "cm": "cm",
    "mm": "mm",
    "um": "um",
    "µm": "um",
    "m/s": "m_s",
    "cm/s": "cm_s",
    "mm/s": "mm_s",
    "m/s^2": "m_s2",
    "m/s2": "m_s2",
    "m/s²": "m_s2",
    "rad/s^2": "rad_s2",
    "rad/s²": "rad_s2",
    "n": "N",
    "kn": "kN",
    "v": "V",
    "mv": "mV",
    "a": "A",
    "ma": "mA",
    "kg": "kg",
    "g": "g",
}
_WITH_UNIT = re.compile(r"(.+?)\s*(?:\(([^()]*)\)|\[([^\[\]]*)\]|/\s*([^\s/]+(/s.?)?))")


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
    ending = _ending(unit)
    name = re.sub(r"\W+", "_", words).strip("_")
    if not ending or not name:
        return heading
    return f"{name.lower()}_{ending}"


def is_unit(cell: str) -> bool:
    """Return whether a cell may be part of a line of units."""
    return cell in ("", "-", "1") or bool(_ending(cell))


def is_time(heading: str) -> bool:
    """Return whether a heading denotes the time, according to its first word."""
    return bool(re.match(r"(time|t|zeit|frame)([^a-z]|$)", heading.lower()))


def _ending(unit: str) -> str:
    return _ENDINGS.get(unit.strip("()[] ").lower().replace("μ", "µ"), "")
