"""Samples of many motions on a section."""

from typing import NamedTuple

import numpy as np


class Samples(NamedTuple):
    """The last points of many motions on a section, as NumPy arrays."""

    states: np.ndarray
    """Points, shape `(motions, keep, n)`; NaN if a motion failed or has fewer
    points.
    """
    times: np.ndarray
    """Times of the points (s, or iterations of a map), shape `(motions, keep)`."""
    hits: np.ndarray
    """Number of impacts since the previous point, shape `(motions, keep)`."""
    rests: np.ndarray
    """Number of completed chatter sequences since the previous point, shape `(motions,
    keep)`.
    """
    final: np.ndarray
    """Final state, a whole number of periods after the start, shape `(motions, n)`."""
    contact: np.ndarray
    """Whether contact lasted throughout, shape `(motions,)`."""
    code: np.ndarray
    """0, or the reason for a failure: an index into `RESULTS`, or `BEHIND`; shape
    `(motions,)`.
    """


BEHIND = -1
"""Code of a start that penetrates the constraint, or is outside the map's domain."""


def with_lanes(old: Samples, which, new: Samples) -> Samples:
    """Return the samples with those of some motions replaced."""

    def put(before, after):
        made = before.copy()
        made[which] = after
        return made

    return Samples(*map(put, old, new))


def filled(samples: Samples, keep: int) -> Samples:
    """Return the samples of each motion, padded at the end to `keep` samples."""
    missing = keep - samples.states.shape[1]
    if missing == 0:
        return samples

    def put(array, empty):
        places = [(0, 0), (0, missing), *[(0, 0)] * (array.ndim - 2)]
        return np.pad(array, places, constant_values=empty)

    return samples._replace(
        states=put(samples.states, np.nan),
        times=put(samples.times, np.nan),
        hits=put(samples.hits, 0),
        rests=put(samples.rests, 0),
    )
