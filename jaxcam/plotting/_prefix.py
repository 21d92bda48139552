"""Units that suit the size of what is drawn: 0.0003 rad is 0.3 mrad."""

import numpy as np


# units that a prefix can be put before; others (rpm, -) keep their numbers
_TAKES_PREFIX = ("rad", "m", "s", "N", "V")


def scaled(unit: str, largest: float) -> tuple[float, str]:
    """A factor and a unit in which `largest` (in `unit`) is not far from one."""
    if unit.partition("/")[0] not in _TAKES_PREFIX or not 0 < largest < 0.05:
        return 1.0, unit
    if not np.isfinite(largest) or largest > 2e-5:
        return 1e3, f"m{unit}"
    return 1e6, f"µ{unit}"
