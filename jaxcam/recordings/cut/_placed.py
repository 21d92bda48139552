"""A surface put where the impacts on it are, within its tolerance."""

import dataclasses

import numpy as np

from ._kinks import find_kinks, WINDOW
from ._motion import Motion
from ._polynomial import crossing, fit_local


# Impacts further from the usual place than this many of their errors do not count
_OUTLIER = 5.0


def placed(motion: Motion, tolerance: float) -> Motion:
    """The motion with its surface moved to where its velocity jumps.

    A surface that is off by many times the noise makes fast impacts short contacts, or
    hides slow ones.

    **Arguments:** `tolerance` is how far the surface may be from where it is stated, in
    the units of the samples; it moves no further.

    **Returns:** the same motion where no jump is within the tolerance.
    """
    time, samples = motion.time, motion.samples
    reach = max(6, round(WINDOW / motion.interval))
    found = []
    for kink in find_kinks(samples, motion.interval, motion.noise):
        # the sample next to the impact may be on either side of it
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
