"""The clock of a recording whose file writes its times with few digits."""

import numpy as np
from jaxtyping import Float


# Digits behind the point with which a file may write its times
_DIGITS = 9
# Fewer samples say nothing of a clock
_LEAST = 16
# s; so late, numbers have no digits of a clock left
_LATEST = 1e6
# Of the last digit: rounding leaves a half of it, and a fitted line moves by some more
_REACH = 0.75


def unrounded(time: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
    """Times (s) of an even clock that were rounded when they were written.

    At 1500 Hz and with four decimals, samples seem to be 0.6 and 0.7 ms apart in turn,
    and neither is the time between samples. Where all times lie on one even clock, some
    of its ticks left out, as well as their last digit can tell, they are that clock's;
    otherwise they are returned as they are.
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
    # none left out comes first: with few digits to a tick, rounding has the same effect
    for counted in (np.ones_like(ticks), np.maximum(ticks, 1.0)):
        place = np.concatenate([[0.0], np.cumsum(counted)])
        even = np.polyval(np.polyfit(place, time, 1), place)
        if np.max(np.abs(even - time)) < _REACH * digit:
            return even
    return time


def _last_digit(time: Float[np.ndarray, " k"]) -> float | None:
    """The place value (s) of the last digit that any of the times has."""
    for digits in range(_DIGITS + 1):
        error = np.max(np.abs(time - np.round(time, digits)))
        if error < 1e-5 * 10.0**-digits:
            return 10.0**-digits
    return None
