"""Convert columns in non-SI units; column names end with the unit."""

import math


# ending of a column name -> (ending in SI, factor). The longest ending wins.
_UNITS: dict[str, tuple[str, float]] = {
    "_s": ("_s", 1.0),
    "_ms": ("_s", 1e-3),
    "_us": ("_s", 1e-6),
    "_rad": ("_rad", 1.0),
    "_deg": ("_rad", math.pi / 180),
    "_turns": ("_rad", 2 * math.pi),
    "_rad_s": ("_rad_s", 1.0),
    "_deg_s": ("_rad_s", math.pi / 180),
    "_rpm": ("_rad_s", 2 * math.pi / 60),
    "_m": ("_m", 1.0),
    "_cm": ("_m", 1e-2),
    "_mm": ("_m", 1e-3),
    "_um": ("_m", 1e-6),
    "_m_s": ("_m_s", 1.0),
    "_cm_s": ("_m_s", 1e-2),
    "_mm_s": ("_m_s", 1e-3),
    "_m_s2": ("_m_s2", 1.0),
    "_mm_s2": ("_m_s2", 1e-3),
    "_rad_s2": ("_rad_s2", 1.0),
    "_deg_s2": ("_rad_s2", math.pi / 180),
    "_kg": ("_kg", 1.0),
    "_kN": ("_N", 1e3),
    "_mN": ("_N", 1e-3),
    "_mV": ("_V", 1e-3),
    "_mA": ("_A", 1e-3),
}


def si(column: str) -> tuple[str, float]:
    """Return the name of a column in SI units and the conversion factor.

    A column without a known unit keeps its name and values.
    """
    for ending in sorted(_UNITS, key=len, reverse=True):
        if column.endswith(ending) and len(column) > len(ending):
            target, factor = _UNITS[ending]
            return column.removesuffix(ending) + target, factor
    return column, 1.0


# ending of a channel name -> its unit as written; the longest ending wins
_WRITTEN = {
    "_rad_s": "rad/s",
    "_rad": "rad",
    "_m_s": "m/s",
    "_m_s2": "m/s^2",
    "_rad_s2": "rad/s^2",
    "_kg": "kg",
    "_m": "m",
    "_N": "N",
    "_V": "V",
    "_A": "A",
    "_s": "s",
}


def unit_of(channel: str) -> str:
    """Return the unit at the end of a channel name, such as `m` for `height_m`, or
    nothing.
    """
    for ending in sorted(_WRITTEN, key=len, reverse=True):
        if channel.endswith(ending):
            return _WRITTEN[ending]
    return ""
