"""Table 5.2: the multipliers of P(1,1), and its fold and flip.

Near the fold the branch is steep in the speed, so the table gives the speed at which
the multipliers have the printed sum; elsewhere it gives the multipliers at the printed
speed. The fold and the first flip follow, next to the values of section 5.2.1.
"""

import numpy as np

from ...models import CamFollower, rad_s_to_rpm
from ..orbits import (
    along_traces,
    first_orbit,
    FLIP,
    FOLD,
    multipliers_at,
    point_on_line,
)
from ..target import Rows, Target


MULTIPLIERS = np.array(
    [
        (135.946698873817, 0.212856564951, 0.996008664393),
        (135.946850039257, 0.214199564174, 0.989769009976),
        (135.947353924057, 0.216351137284, 0.979943000383),
        (135.949033540057, 0.220281698370, 0.962513414400),
        (135.951832900057, 0.224549930832, 0.944309362903),
        (
            147.941373499943,
            -0.467436119698 - 0.300839993821j,
            -0.467436119698 + 0.300839993821j,
        ),
        (
            148.962048199932,
            -0.521622451717 - 0.214489798539j,
            -0.521622451717 + 0.214489798539j,
        ),
        (150.186857839919, -0.467765740979, -0.703735852712),
        (151.656629407902, -0.353243069838, -0.970265166132),
        (153.420355289483, -0.297944998464, -1.206154145399),
    ]
)
"""Speed (rpm) and the two multipliers of P(1,1)."""


SPEEDS = np.real(MULTIPLIERS[:, 0])
TRACES = np.real(MULTIPLIERS[:, 1] + MULTIPLIERS[:, 2])
PRODUCTS = np.real(MULTIPLIERS[:, 1] * MULTIPLIERS[:, 2])
NEAR_FOLD = SPEEDS < 140.0
"""Rows close to the fold, where the multipliers depend strongly on the speed."""


# Speeds (rpm) of the fold and the flip of P(1,1) in section 5.2.1; according to the
# text, the flip is "close to" this speed
FOLD_SPEED = 135.946
FLIP_SPEED = 152.0


def compute(system: CamFollower) -> Rows:
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
    return rows


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


TARGET = Target("Multipliers along the P(1,1) branch", compute)
