"""Units of channels and columns: endings of names, written forms, conversion to SI."""

import math
import re
from typing import NamedTuple


class _Unit(NamedTuple):
    """`written`: forms in headings, the first for output, in lower case except where
    the case matters; `si`, `factor`: the ending in SI and the conversion to it.
    """

    written: tuple[str, ...]
    si: str
    factor: float = 1.0


_DEGREE = math.pi / 180
# ending of a name, without the underscore -> unit
_UNITS = {
    "s": _Unit(("s", "sec"), "s"),
    "ms": _Unit(("ms",), "s", 1e-3),
    "us": _Unit(("µs", "us"), "s", 1e-6),
    "rad": _Unit(("rad",), "rad"),
    "deg": _Unit(("deg", "°"), "rad", _DEGREE),
    "turns": _Unit(("turns",), "rad", 2 * math.pi),
    "rad_s": _Unit(("rad/s",), "rad_s"),
    "deg_s": _Unit(("deg/s", "°/s"), "rad_s", _DEGREE),
    "rpm": _Unit(("rpm",), "rad_s", 2 * math.pi / 60),
    "rad_s2": _Unit(("rad/s^2", "rad/s2", "rad/s²"), "rad_s2"),
    "deg_s2": _Unit(
        ("deg/s^2", "deg/s2", "deg/s²", "°/s^2", "°/s2", "°/s²"), "rad_s2", _DEGREE
    ),
    "m": _Unit(("m",), "m"),
    "cm": _Unit(("cm",), "m", 1e-2),
    "mm": _Unit(("mm",), "m", 1e-3),
    "um": _Unit(("µm", "um"), "m", 1e-6),
    "m_s": _Unit(("m/s",), "m_s"),
    "cm_s": _Unit(("cm/s",), "m_s", 1e-2),
    "mm_s": _Unit(("mm/s",), "m_s", 1e-3),
    "m_s2": _Unit(("m/s^2", "m/s2", "m/s²"), "m_s2"),
    "mm_s2": _Unit(("mm/s^2", "mm/s2", "mm/s²"), "m_s2", 1e-3),
    "kg": _Unit(("kg",), "kg"),
    # gram or acceleration of gravity: not converted
    "g": _Unit(("g",), "g"),
    "N": _Unit(("N", "n"), "N"),
    "kN": _Unit(("kN", "kn"), "N", 1e3),
    # MN is a meganewton
    "mN": _Unit(("mN",), "N", 1e-3),
    "V": _Unit(("V", "v"), "V"),
    "mV": _Unit(("mV", "mv"), "V", 1e-3),
    "A": _Unit(("A", "a"), "A"),
    "mA": _Unit(("mA", "ma"), "A", 1e-3),
}
_LONGEST_FIRST = sorted(_UNITS, key=len, reverse=True)
_ENDINGS = {form: ending for ending, unit in _UNITS.items() for form in unit.written}


def si(column: str) -> tuple[str, float]:
    """Return the name of a column in SI units and the conversion factor.

    A column without a known unit keeps its name and values.
    """
    name, ending = _divided(column)
    if not ending:
        return column, 1.0
    return f"{name}_{_UNITS[ending].si}", _UNITS[ending].factor


def unit_of(channel: str) -> str:
    """Return the unit at the end of a channel name, such as `m` for `height_m`, or
    nothing.
    """
    ending = _divided(channel)[1]
    return _UNITS[ending].written[0] if ending else ""


def without_unit(channel: str) -> str:
    """Return a channel name in words and without its unit: `cam angle` for
    `cam_angle_rad`.
    """
    return _divided(channel)[0].replace("_", " ")


def ending_of(written: str) -> str:
    """Return the ending of a name for a unit as written, such as `m_s2` for `m/s²`, or
    nothing.
    """
    unit = written.strip("()[] ").replace("μ", "µ")
    return _ENDINGS.get(unit) or _ENDINGS.get(unit.lower(), "")


def si_of(written: str) -> tuple[str, float] | None:
    """Return the SI unit and the conversion factor of a unit as written.

    Both are empty (the factor NaN) if one of several units, as in `N/mm`, is not in SI.
    A unit that is not known, and one in SI, returns `None`.
    """
    ending = ending_of(written)
    if ending:
        unit = _UNITS[ending]
        return None if unit.factor == 1 else (_UNITS[unit.si].written[0], unit.factor)
    endings = map(ending_of, re.findall(r"°?[^\W\d_]+|°", written))
    factors = [_UNITS[one].factor for one in endings if one]
    return ("", math.nan) if any(one != 1 for one in factors) else None


def _divided(name: str) -> tuple[str, str]:
    """Return a name without its unit, and the ending, which is empty if the unit is
    unknown.
    """
    for ending in _LONGEST_FIRST:
        if name.endswith(f"_{ending}") and len(name) > len(ending) + 1:
            return name.removesuffix(f"_{ending}"), ending
    return name, ""
