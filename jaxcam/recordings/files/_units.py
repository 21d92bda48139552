"""Column names end in their unit; other than SI ones are converted."""

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
    "_mm": ("_m", 1e-3),
    "_m_s": ("_m_s", 1.0),
    "_mm_s": ("_m_s", 1e-3),
    "_kN": ("_N", 1e3),
    "_mV": ("_V", 1e-3),
}


def si(column: str) -> tuple[str, float]:
    """The name of a column in SI units and the factor that takes it there.

    A column without a known unit at the end keeps its name and its numbers.
    """
    for ending in sorted(_UNITS, key=len, reverse=True):
        if column.endswith(ending) and len(column) > len(ending):
            target, factor = _UNITS[ending]
            return column.removesuffix(ending) + target, factor
    return column, 1.0
