"""Shift a surface to the observed impacts, within its tolerance."""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ._jump_point import jump_point
from ._motion import Motion


# Impacts further from the median position than this many standard errors are ignored
_OUTLIER = 5.0


class JumpGaps(NamedTuple):
    """For each jump in velocity, `(j,)`: its time (s), the gap at which the motions
    before and after it meet, its standard error, and whether they meet near the jump.
    """

    time: Float[np.ndarray, " j"]
    gap: Float[np.ndarray, " j"]
    error: Float[np.ndarray, " j"]
    close: Bool[np.ndarray, " j"]


def placed(motion: Motion, tolerance: float) -> Motion:
    """Return the motion with its surface shifted to the velocity jumps.

    A surface error of many times the noise turns fast impacts into short contacts, or
    hides slow impacts.

    **Arguments:** `tolerance` is the largest error of the given position, in the units
    of the samples, and therefore the largest shift.

    **Returns:** the unchanged motion if no jump is within the tolerance.
    """
    found = jump_gaps(motion)
    near = np.abs(found.gap) < tolerance + _OUTLIER * found.error
    return shifted(motion, found.gap[near], found.error[near], tolerance)


def jump_gaps(motion: Motion) -> JumpGaps:
    """Return the gaps at the jumps in velocity, at which the motion meets a surface."""
    time, rows = motion.time, []
    for kink in motion.jumps():
        found = jump_point(time, motion.samples, kink, motion.interval, motion.noise)
        off = found.before - np.interp(found.time, time, motion.contact)
        rows.append((found.time, off, found.stderr, found.close))
    moment, off, error, close = np.array(rows, dtype=float).reshape(-1, 4).T
    return JumpGaps(moment, off, error, close.astype(bool))


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
