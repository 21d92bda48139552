"""Table 5.2: the multipliers of P(1,1), and where it is born and doubles."""

from typing import TYPE_CHECKING

import numpy as np

from ..models import CamFollower, rad_s_to_rpm
from ._frame import frame
from ._orbits import (
    along_traces,
    first_orbit,
    FLIP,
    FOLD,
    multipliers_at,
    point_on_line,
)
from ._printed import FLIP_SPEED, FOLD_SPEED, MULTIPLIERS, NEAR_FOLD, SPEEDS, TRACES


if TYPE_CHECKING:
    import pandas as pd


def table_5_2(system: CamFollower) -> "pd.DataFrame":
    """Table 5.2 beside the P(1,1) branch of `system`.

    Near the fold the branch is steep in the speed. There the speed is computed at which
    the multipliers have the printed sum; elsewhere the multipliers at the printed
    speed. Fold and first flip follow, beside the values of section 5.2.1.
    """
    start = first_orbit(system)
    rows = []
    for k in np.flatnonzero(NEAR_FOLD):
        found = np.nan
        if start is not None:
            found = rad_s_to_rpm(along_traces(system, start, TRACES[k]).parameter)
        name = f"speed where the multipliers add up to {TRACES[k]:.6f}"
        rows.append((name, SPEEDS[k], found, "rpm"))
    for k in np.flatnonzero(~NEAR_FOLD):
        values = np.full(2, np.nan, dtype=complex)
        if start is not None:
            values = multipliers_at(system, start, SPEEDS[k])
        rows += _pair(SPEEDS[k], MULTIPLIERS[k, 1:], values)
    fold = flip = np.nan
    if start is not None:
        near = along_traces(system, start, TRACES[0])
        fold = rad_s_to_rpm(point_on_line(system, near, FOLD).parameter)
        near = along_traces(system, start, TRACES[-2])
        flip = rad_s_to_rpm(point_on_line(system, near, FLIP).parameter)
    rows.append(("fold", FOLD_SPEED, fold, "rpm"))
    rows.append(("first flip", FLIP_SPEED, flip, "rpm"))
    return frame(rows)


def _pair(speed, printed, found):
    at = f"at {speed:.6f} rpm"
    if printed[0].imag != 0:
        parts = [
            (f"multipliers {at}, real part", printed[1].real, found[1].real),
            (f"multipliers {at}, imaginary part", printed[1].imag, found[1].imag),
        ]
    else:
        parts = [
            (f"multiplier 1 {at}", printed[0].real, found[0].real),
            (f"multiplier 2 {at}", printed[1].real, found[1].real),
        ]
    trace = (f"sum {at}", printed.sum().real, found.sum().real)
    product = (f"product {at}", printed.prod().real, found.prod().real)
    return [(*row, "") for row in (*parts, trace, product)]
