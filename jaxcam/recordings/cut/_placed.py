"""Shift a surface to the observed impacts, within its tolerance."""

import dataclasses

import numpy as np

from ._kinks import find_kinks, WINDOW
from ._motion import Motion
from ._polynomial import crossing, fit_local


# Impacts further from the median position than this many standard errors are ignored
_OUTLIER = 5.0


def placed(motion: Motion, tolerance: float) -> Motion:
    """Return the motion with its surface shifted to the velocity jumps.

    A surface error of many times the noise turns fast impacts into short contacts, or
    hides slow impacts.

    **Arguments:** `tolerance` is the largest error of the given position, in the units
    of the samples, and therefore the largest shift.

    **Returns:** the unchanged motion if no jump is within the tolerance.
    """
    time, samples = motion.time, motion.samples
    reach = max(6, round(WINDOW / motion.interval))
    found = []
    for kink in find_kinks(samples, motion.interval, motion.noise):
        # the sample next to the impact may belong to either side
        left = slice(max(0, kink - 1 - reach), kink - 1)
        right = slice(kink + 1, kink + 1 + reach)
        origin = float(time[kink] - motion.interval / 2)
        before = fit_local(time[left], samples[left], motion.noise, origin)
        after = fit_local(time[right], samples[right], motion.noise, origin)
        moment, _ = crossing(before, after, origin, 3 * motion.interval)
        off = before.value(moment) - np.interp(moment, time, motion.contact)
        error = before.value_stderr(moment) + after.value_stderr(moment)
        if abs(off) < tolerance + _OUTLIER * error:
            found.append((off, error))
    if not found:
        return motion
    off, error = np.array(found).T
    usual = np.abs(off - np.median(off)) < _OUTLIER * np.maximum(error, motion.noise)
    if not np.any(usual):
        return motion
    weight = 1 / error[usual] ** 2
    shift = np.sum(weight * off[usual]) / np.sum(weight)
    shift = float(np.clip(shift, -tolerance, tolerance))
    return dataclasses.replace(motion, contact=motion.contact + shift)
