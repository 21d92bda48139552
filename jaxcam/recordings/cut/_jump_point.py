"""Locate one impact without a model, from the motions before and after it."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ._kinks import WINDOW
from ._polynomial import crossing, fit_local


# Largest distance of the impact from the jump in velocity, in sampling intervals
_REACH = 3


class JumpPoint(NamedTuple):
    """The point at which the motions before and after a jump in velocity meet."""

    time: float
    """Time of the impact (s)."""
    before: float
    """Value of the motion before the impact at this time."""
    after: float
    """Value of the motion after it."""
    stderr: float
    """Sum of the standard errors of both values."""
    close: bool
    """Whether the motions meet near the jump."""


def jump_point(
    time: Float[np.ndarray, " k"],
    samples: Float[np.ndarray, " k"],
    jump: int | np.integer,
    interval: float,
    noise: float,
) -> JumpPoint:
    """Return the impact at a jump in velocity.

    **Arguments:** `jump` is the index of the first sample after the jump, as from
    `find_kinks`; `interval`: sampling interval; `noise`: standard deviation of a
    sample.
    """
    reach = max(6, round(WINDOW / interval))
    # the sample next to the impact may belong to either side
    left = slice(max(0, jump - 1 - reach), jump - 1)
    right = slice(jump + 1, jump + 1 + reach)
    origin = float(time[jump] - interval / 2)
    before = fit_local(time[left], samples[left], noise, origin)
    after = fit_local(time[right], samples[right], noise, origin)
    moment, _ = crossing(before, after, origin, _REACH * interval)
    return JumpPoint(
        moment,
        before.value(moment),
        after.value(moment),
        before.value_stderr(moment) + after.value_stderr(moment),
        bool(abs(moment - origin) < _REACH * interval),
    )
