"""Shift a surface to the observed impacts, within its tolerance."""

import dataclasses

import numpy as np
from jaxtyping import Float

from ._jump_point import jump_point
from ._motion import Motion


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
    found = []
    for kink in motion.jumps():
        impact = jump_point(time, samples, kink, motion.interval, motion.noise)
        off = impact.before - np.interp(impact.time, time, motion.contact)
        if abs(off) < tolerance + _OUTLIER * impact.stderr:
            found.append((off, impact.stderr))
    off, error = np.array(found).reshape(-1, 2).T
    return shifted(motion, off, error, tolerance)


def shifted(
    motion: Motion,
    off: Float[np.ndarray, " i"],
    error: Float[np.ndarray, " i"],
    tolerance: float,
) -> Motion:
    """Return the motion with its surface shifted to the impacts, as far as the
    tolerance allows.

    **Arguments:** the gaps at the impacts, and their standard errors.
    """
    if not len(off):
        return motion
    usual = np.abs(off - np.median(off)) < _OUTLIER * np.maximum(error, motion.noise)
    if not np.any(usual):
        return motion
    weight = 1 / error[usual] ** 2
    shift = np.sum(weight * off[usual]) / np.sum(weight)
    shift = float(np.clip(shift, -tolerance, tolerance))
    return dataclasses.replace(motion, contact=motion.contact + shift)
