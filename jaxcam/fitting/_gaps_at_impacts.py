"""Fit moving surfaces to the impacts of a recording, before it is segmented.

Impacts are found as jumps in velocity, without the surfaces, and the gaps must vanish
there. This determines, for example, the phase of a shaken table in a recording in which
the phase is unknown.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import least_squares

from ..recordings.cut import gap_jumps
from .engine import Parameter


# Number of values, spread evenly over the tolerance, from which the most influential
# parameter starts, and of starts that are refined
_VALUES, _REFINED = 24, 3
# An impact lies on the surface if its gap is at most this number of standard errors
_ON, _USUAL = 5.0, 2.0
# Minimum fraction of the impacts that must lie on the surfaces, and minimum number of
# them in addition to that of the parameters
_MOST, _MORE = 0.7, 2
# Jumps of several gaps within this number of sampling intervals are the same jump
_SAME = 3
# Largest change of a parameter, in units of its tolerance
_OUTSIDE = 1.5


class GapPoints(NamedTuple):
    """Impacts: time (s), the index of the gap that closed, the value that the model's
    parameters give for it, and its standard error, `(i,)` each.
    """

    time: Float[np.ndarray, " i"]
    gap: Int[np.ndarray, " i"]
    off: Float[np.ndarray, " i"]
    error: Float[np.ndarray, " i"]


class FittedValues(NamedTuple):
    """Values of the parameters `(p,)`, which of them affect the gaps at the impacts,
    `(p,)`, their covariance `(p, p)`, zero for the others, and the gap that remains at
    each impact, `(i,)`, NaN if the impact was left out.
    """

    values: Float[np.ndarray, " p"]
    fitted: Bool[np.ndarray, " p"]
    covariance: Float[np.ndarray, "p p"]
    left: Float[np.ndarray, " i"]


def gap_points(
    time: Float[np.ndarray, " k"],
    gaps: Float[np.ndarray, "g k"],
    errors: Float[np.ndarray, " g"],
    interval: float,
) -> GapPoints:
    """Return the impacts in a recording.

    A jump in velocity belongs to the gap that is closest to zero, relative to its
    largest error; it is ignored if no gap can be zero there.

    **Arguments:** the gaps at the samples, and the largest errors of the gaps.
    """
    rows = []
    for k, (gap, error) in enumerate(zip(gaps, errors, strict=True)):
        jumps = gap_jumps(time, gap, interval)
        near = np.abs(jumps.gap) < error + _ON * jumps.error
        for i in np.flatnonzero(jumps.close & near):
            off, stderr = jumps.gap[i], jumps.error[i]
            rows.append((jumps.time[i], k, off, stderr, abs(off) / (error + stderr)))
    rows.sort()
    best: list[tuple] = []
    for row in rows:
        if not best or row[0] - best[-1][0] > _SAME * interval:
            best.append(row)
        elif row[-1] < best[-1][-1]:
            best[-1] = row
    moment, gap, off, stderr, _ = np.array(best, dtype=float).reshape(-1, 5).T
    return GapPoints(moment, gap.astype(int), off, stderr)


def fitted_to_impacts(
    points: GapPoints,
    gaps_of: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]],
    parameters: Sequence[Parameter],
    values: Float[np.ndarray, " p"],
) -> FittedValues | None:
    """Return the parameters with which the gaps vanish at the impacts, or `None` if
    there are none within, or slightly outside, their tolerances, or if the impacts do
    not determine them.

    **Arguments:** `gaps_of(values)` returns the gap at each impact, `(i,)`, and its
    derivatives with respect to the parameters, `(i, p)`; the parameters, and their
    values in the model.
    """
    start, slopes = gaps_of(values)
    reach = np.max(np.abs(slopes), axis=0, initial=0.0)
    moving = np.flatnonzero(reach > 0)
    if not len(moving) or len(points.time) < len(moving) + _MORE:
        return None
    nominal = np.array([p.nominal_in(v) for p, v in zip(parameters, values)])
    low, high = np.array([(p.lower, p.upper) for p in parameters]).T
    chosen = [parameters[int(k)] for k in moving]
    stated = np.array([math.isfinite(one.tolerance) for one in chosen])
    scale = np.array(
        [one.tolerance if there else 1.0 for one, there in zip(chosen, stated)]
    )
    known = scale / np.array([one.prior_stderr for one in chosen])

    def values_of(steps):
        moved = nominal.copy()
        moved[moving] += scale * steps
        return np.clip(moved, low, high)

    def misfits(steps):
        gap, _ = gaps_of(values_of(steps))
        return np.append((gap - start + points.off) / points.error, known * steps)

    def rates(steps):
        _, slopes = gaps_of(values_of(steps))
        own = slopes[:, moving] * scale / points.error[:, None]
        return np.concatenate([own, np.diag(known)])

    def robust(steps):
        return float(np.sum(np.sqrt(1 + misfits(steps) ** 2)))

    first = int(np.argmax(reach[moving] * scale))
    shares = (2 * np.arange(_VALUES) + 1) / _VALUES - 1
    trials = [
        np.zeros(len(moving)),
        *(share * np.eye(len(moving))[first] for share in shares),
    ]
    trials = sorted(filter(lambda one: np.isfinite(robust(one)), trials), key=robust)
    if not trials:
        return None
    best = min(
        (
            least_squares(misfits, trial, jac=rates, loss="soft_l1")  # pyright: ignore
            for trial in itertools.islice(trials, _REFINED)
        ),
        key=lambda one: one.cost,
    )
    count = len(points.time)
    off = misfits(best.x)[:count]
    on = np.abs(off) < _ON
    if np.median(np.abs(off)) > _USUAL or np.mean(on) < _MOST:
        return None
    if np.any(np.abs(best.x[stated]) > _OUTSIDE):
        return None
    rows = rates(best.x)[np.append(on, np.ones(len(moving), dtype=bool))]
    if np.linalg.matrix_rank(rows) < len(moving):
        return None
    inverse = np.linalg.inv(rows.T @ rows)
    covariance = np.zeros((len(nominal), len(nominal)))
    covariance[np.ix_(moving, moving)] = inverse * np.outer(scale, scale)
    left = np.where(on, off * points.error, np.nan)
    return FittedValues(values_of(best.x), reach > 0, covariance, left)
