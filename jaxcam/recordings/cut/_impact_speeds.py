"""Estimate the velocities before and after an impact."""

from typing import NamedTuple

from ._motion import Motion
from ._polynomial import LocalFit


class Speed(NamedTuple):
    """The rate of change of a channel, and its standard error."""

    value: float
    stderr: float


def speeds(
    motion: Motion,
    fits: tuple[LocalFit, LocalFit],
    span: tuple[int, int, int],
    time: float,
) -> tuple[Speed, Speed]:
    """Return the velocities before and after an impact.

    Each is the slope of a fit to the positions or, if it is more accurate, the measured
    rate.

    **Arguments:** the motion; the fits to the positions before and after the impact;
    the first sample of the flight before it, the first sample after it, and one past
    the last of the flight after it; the time of the impact.
    """
    first, place, last = span
    slopes = [Speed(one.slope(time), one.slope_stderr(time)) for one in fits]
    if motion.seen is not None:
        surface = float(motion.rate[place])
        sides = motion.seen.before(first, place), motion.seen.after(place, last)
        shown = [Speed(surface + o.value(time), o.value_stderr(time)) for o in sides]
        slopes = [min(pair, key=lambda one: one.stderr) for pair in zip(slopes, shown)]
    return slopes[0], slopes[1]
