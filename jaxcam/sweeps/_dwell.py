"""Compute a diagram as in an experiment: wait at each value, then record, for times
given in seconds.
"""

import functools
import math
from collections.abc import Callable

import numpy as np

from ..parameters import Pick
from ._diagram_job import CarriedJob, one_after_the_other
from .blocks import Arrays
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


class DwellJob(CarriedJob):
    """Computes the motions of a sweep, for settling and recording times in seconds."""

    def __init__(self, *arguments, dwell: tuple[float, float]):
        self.dwell = dwell
        super().__init__(*arguments)

    def work(self, block: int, before: Arrays | None) -> Callable[[], Arrays]:
        first, last = self.layout.bounds(block)
        values = self.values[first:last]
        turns, keep = dwell_turns(self.section, self.where, values, self.dwell)
        return functools.partial(
            one_after_the_other,
            self.section,
            self.where,
            values,
            self.starts[first:last],
            self.first[first:last],
            None if before is None else before["final"][-1],
            turns,
            keep,
            self.keep,
            self.period_tolerance,
        )

    def _layout(self, going, direction: str, block: int | None):
        layout = super()._layout(going, direction, block)
        identity = {**layout.identity, "dwell": list(map(float, self.dwell))}
        return layout._replace(identity=identity)
