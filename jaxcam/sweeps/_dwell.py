"""Convert the settling and recording times of an experiment to numbers of periods."""

import math

import numpy as np

from ..parameters import Pick
from .sections import AbstractSection


_SLACK = 1e-9
"""Tolerance in periods, so that rounding does not lose a period."""


def dwell_turns(
    section: AbstractSection, where: Pick, values, dwell: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the number of periods at each value, and the number of recorded periods.

    **Arguments:** `dwell`: settling time and recording time (s). The settling time is
    rounded up to full periods, and only full periods are recorded.

    Raises:
        ValueError: Less than one full period would be recorded.
    """
    if not section.regular:
        raise ValueError("dwell requires samples once per period, not at impacts")
    wait, store = (float(seconds) for seconds in dwell)
    if not (0 <= wait < math.inf and 0 < store < math.inf):
        raise ValueError(
            f"dwell is {dwell}; give the settling time and the recording time (s), "
            "such as (60, 10)"
        )
    length = np.broadcast_to(section.turn(where, values), np.shape(values))
    waited = np.ceil(wait / length - _SLACK).astype(int)
    stored = np.floor(store / length + _SLACK).astype(int)
    if np.min(stored) < 1:
        raise ValueError(
            f"dwell records {store:g} s, but a period takes up to "
            f"{np.max(length):.3g} s; record longer"
        )
    return waited + stored, stored
