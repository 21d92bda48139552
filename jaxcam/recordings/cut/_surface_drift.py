"""Estimate how the surface of a cam, as its sensor sees it, moves in the course of
recordings.

A support that warms up and a sensor that drifts displace impacts and contacts in the
course of time. Impacts at the same angle of the cam reveal this displacement. It is a
random walk in time between knots, in addition to an offset of each recording and to an
error of the profile that all recordings share; all have Gaussian priors, and the
evidence decides whether there is a displacement at all (C. K. I. Williams, C. E.
Rasmussen, Gaussian Processes for Machine Learning, 2006, section 5.4.1).
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from .._drive import Drive
from .._recording import Recording
from ._bend import spread, WAVES, waves
from ._impact_points import SurfacePoints
from ._surface import Surface


# Correlation lengths (rad) of the common profile error to try, and its prior standard
# deviation, relative to that of the points
_LENGTHS = (0.2, 0.5, 1.0, 2.0)
_COMMON = 10.0
# Prior standard deviation of the offset of a recording, in units of the noise
_OFFSET = 3.0
# Knots for each turn of the drive, and their largest number in a recording
_DENSE, _KNOTS = 2, 33
# Standard deviations of the change from one knot to the next to try, in units of the
# noise
_STEPS = (0.3, 1.0, 3.0, 10.0)
# Required gain of a displacement in twice the log-likelihood, as for a bend of the cam
_SURE = 30.0
# Points further from the fit than this number of standard errors, or of robust standard
# deviations, are left out
_FAR = 4.0
_PASSES = 5


class _Unknowns(NamedTuple):
    """The linear problem of all recordings.

    The coefficients of the common profile come first, then the displacement at the
    `knots` of each recording. `rows` `(n, p)`, `off` `(n,)`: in units of the standard
    error of each point.
    """

    knots: list[Float[np.ndarray, " k"]]
    rows: Float[np.ndarray, "n p"]
    off: Float[np.ndarray, " n"]
    size: float
    offset: float

    def prior(self, length: float, step: float) -> Float[np.ndarray, "p p"]:
        """Return a matrix that times its transpose is the prior covariance.

        **Arguments:** the correlation length of the profile error, and the standard
        deviation of the change between two knots.
        """
        count = self.rows.shape[1]
        found = np.zeros((count, count))
        found[range(WAVES), range(WAVES)] = self.size * spread(length)
        first = WAVES
        for knots in self.knots:
            last = first + len(knots)
            walk = np.tril(np.full((len(knots), len(knots)), step))
            # the offset of the recording
            walk[:, 0] = self.offset
            found[first:last, first:last] = walk
            first = last
        return found

    def solved(self, length: float, step: float, kept: Int[np.ndarray, " m"]):
        """Return twice the logarithm of the evidence, apart from a constant, and the
        most likely coefficients, given the points with the indices `kept`.
        """
        prior = self.prior(length, step)
        inside = self.rows[kept] @ prior
        matrix = np.eye(len(prior)) + inside.T @ inside
        target = inside.T @ self.off[kept]
        found = np.linalg.solve(matrix, target)
        _, price = np.linalg.slogdet(matrix)
        return float(target @ found - price), prior @ found

    def moved(self, found) -> list[Float[np.ndarray, " k"]]:
        """Return the displacement at the knots of each recording, zero on average."""
        ends = np.cumsum([WAVES, *map(len, self.knots)])
        values = found[ends[0] :] - np.mean(found[ends[0] :])
        return np.split(values, (ends[1:] - ends[0])[:-1])


def surface_drifts(
    recordings: Sequence[Recording],
    drives: Sequence[Drive],
    surface: Surface,
    points: Sequence[SurfacePoints],
    noise: float,
) -> list[Float[np.ndarray, " k"]] | None:
    """Return the displacement of the surface at each sample of each recording, or
    `None` if none is significant.

    **Arguments:** a surface fitted to all recordings; for each recording, points of its
    surface; the standard deviation of a sample.
    """
    if not any(len(own.time) for own in points):
        return None
    unknowns = _unknowns(recordings, drives, surface, points, noise)
    steps = [step * noise for step in _STEPS]
    kept = _without_outliers(unknowns, steps[2])
    still = max(unknowns.solved(length, 0.0, kept)[0] for length in _LENGTHS)
    tried = [unknowns.solved(*one, kept) for one in itertools.product(_LENGTHS, steps)]
    best, found = max(tried, key=lambda one: one[0])
    if best < still + _SURE:
        return None
    moved = unknowns.moved(found)
    return [
        np.interp(recording.time, knots, values)
        for recording, knots, values in zip(recordings, unknowns.knots, moved)
    ]


def _unknowns(
    recordings, drives, surface: Surface, points: Sequence[SurfacePoints], noise: float
) -> _Unknowns:
    """Return the linear problem for the points of all recordings."""
    knots = []
    for recording, drive in zip(recordings, drives):
        turns = abs(drive.angle[-1] - drive.angle[0]) / (2 * np.pi)
        count = int(np.clip(round(_DENSE * turns) + 1, 2, _KNOTS))
        knots.append(np.linspace(recording.time[0], recording.time[-1], count))
    total, first, rows, off, error = sum(map(len, knots)), 0, [], [], []
    for own, places in zip(points, knots):
        moved = np.zeros((len(own.time), total))
        for k, unit in enumerate(np.eye(len(places))):
            moved[:, first + k] = np.interp(own.time, places, unit)
        first += len(places)
        rows.append(np.hstack([np.asarray(waves(jnp.asarray(own.turned))), moved]))
        off.append(own.angle - np.asarray(surface.angle(own.turned)))
        error.append(np.hypot(own.error, noise))
    joined, errors = np.concatenate(off), np.concatenate(error)
    size = _COMMON * max(float(np.std(joined)), noise)
    return _Unknowns(
        knots,
        np.concatenate(rows) / errors[:, None],
        joined / errors,
        size,
        _OFFSET * noise,
    )


def _without_outliers(unknowns: _Unknowns, step: float) -> Int[np.ndarray, " m"]:
    """Return the indices of the points near the fit with a flexible displacement."""
    kept = np.arange(len(unknowns.off))
    for _ in range(_PASSES):
        _, found = unknowns.solved(_LENGTHS[0], step, kept)
        left = np.abs(unknowns.off - unknowns.rows @ found)
        scatter = max(1.0, float(np.median(left[kept])) / 0.6745)
        near = np.flatnonzero(left < _FAR * scatter)
        if np.array_equal(near, kept):
            break
        kept = near
    return kept
