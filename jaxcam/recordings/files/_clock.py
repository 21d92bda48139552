"""Reconstruct the clock of a recording whose times are written with few digits."""

import numpy as np
from jaxtyping import Float


# Maximum number of decimals that the times in a file may have
_DIGITS = 9
# Smallest number of samples to determine a clock
_LEAST = 16
# Largest time (s) for which a clock is reconstructed; larger times leave too few digits
# for it
_LATEST = 1e6
# Largest deviation from a clock, in units of the last digit: rounding error of one
# half, plus the error of the fitted line
_REACH = 0.75
# Smallest number of double steps that may be due to rounding alone: fewer missing
# samples may happen to lie near the line of a uniform clock
_DOUBLE_STEPS = 8


def unrounded(time: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """Return the times (s) of a uniform clock that were rounded in the file.

    At 1500 Hz with four decimals, samples appear to be alternately 0.6 and 0.7 ms
    apart, and neither is the actual interval. If all times lie on one uniform clock
    (possibly with missing ticks) within their last digit, the times of that clock are
    returned; otherwise they are unchanged.
    """
    steps = np.diff(time)
    if len(time) < _LEAST or not np.all(steps > 0) or np.max(np.abs(time)) > _LATEST:
        return time
    usual = float(np.median(steps))
    digit = _last_digit(time)
    if digit is None or np.all(np.abs(steps - usual) < 1e-3 * digit):
        return time
    near = np.abs(steps - usual) < 1.5 * digit
    ticks = np.round(steps / np.mean(steps[near]))
    hypotheses = [np.maximum(ticks, 1.0)]
    if np.sum(ticks > 1) >= _DOUBLE_STEPS:
        # rounding to about one digit per tick has the same effect as missing ticks, if
        # these are evenly spaced
        hypotheses.insert(0, np.ones_like(ticks))
    for counted in hypotheses:
        place = np.concatenate([[0.0], np.cumsum(counted)])
        even = np.polyval(np.polyfit(place, time, 1), place)
        if np.max(np.abs(even - time)) < _REACH * digit:
            return even
    return time


def _last_digit(time: Float[np.ndarray, " k"]) -> float | None:
    """Return the place value (s) of the last digit of the times."""
    for digits in range(_DIGITS + 1):
        error = np.max(np.abs(time - np.round(time, digits)))
        if error < 1e-5 * 10.0**-digits:
            return 10.0**-digits
    return None
