"""Linearise the recordings about a point, block by block."""

import dataclasses
from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...fitting import Fit, Problem
from ...fitting.engine import (
    assemble,
    eliminate_states,
    free_columns,
    off_nominal,
    Point,
    prior_information,
    Weights,
)


# Negative eigenvalue of an information matrix, relative to the largest one, that may be
# a rounding error
_ROUNDING = 1e-6
# Information on the state of a piece, relative to that of a usual piece, above which
# its derivatives diverge
_DIVERGED = 1e6
# Largest number of an equation: products of three are finite
_LARGEST = float(np.cbrt(np.finfo(float).max))


@dataclasses.dataclass(frozen=True)
class Blocks:
    """The likelihood about a point as a quadratic function, block by block.

    A block is a section of one recording. `information` `(b, g, g)` and `score` `(b,
    g)` are in units of the parameter scales, with the states eliminated; `prior` `(g,)`
    and `pull` `(g,)` are the contributions of the tolerances to both. `owner` `(g,)` is
    the index of the recording to which a parameter belongs, zero if all share it.
    """

    names: tuple[str, ...]
    scale: Float[np.ndarray, " g"]
    record: tuple[str, ...]
    start: Float[np.ndarray, " b"]
    information: Float[np.ndarray, "b g g"]
    score: Float[np.ndarray, "b g"]
    prior: Float[np.ndarray, " g"]
    pull: Float[np.ndarray, " g"]
    owner: Int[np.ndarray, " g"]

    def rows(self, names) -> np.ndarray:
        wanted = set(names)
        return np.array([k for k, n in enumerate(self.names) if n in wanted], dtype=int)

    def total(self, weight=None):
        """Return the weighted sums of information and score over all blocks, including
        the contributions of the tolerances.
        """
        weight = np.ones(len(self.record)) if weight is None else weight
        information = np.einsum("b,bij->ij", weight, self.information)
        score = np.einsum("b,bi->i", weight, self.score)
        return information + np.diag(self.prior), score + self.pull


def blocks_of(
    problem: Problem, point: Point, slices: int = 1, names: Sequence[str] | None = None
) -> Blocks:
    """Return the score and the information of parameters about a point, for sections of
    each recording.
    """
    columns = free_columns(problem, names)
    local, scales = jnp.asarray(columns.local), jnp.asarray(columns.scales)
    longest = max(part.recording.duration for part in problem.segments)
    edges = np.linspace(0.0, longest, slices + 1)
    edges[0], edges[-1] = -np.inf, np.inf
    size = len(columns.scale)
    record, start, information, score = [], [], [], []
    for a, b in zip(edges, edges[1:]):
        inside = problem.between(problem.begun + a, problem.begun + b)
        found = _assembled(problem, inside, point, local, scales)
        found = jax.tree.map(np.asarray, eliminate_states(found))
        for r, (name, place) in enumerate(zip(problem.records, columns.place)):
            # a parameter with separate values has a row for each recording
            used = np.flatnonzero(place >= 0)
            rows = place[used]
            whole, right = np.zeros((size, size)), np.zeros(size)
            whole[np.ix_(rows, rows)] = found.information[r][np.ix_(used, used)]
            right[rows] = found.score[r][used]
            if not _usable(whole, right):
                # a motion that diverges says nothing about the parameters
                whole, right = np.zeros_like(whole), np.zeros_like(right)
            record.append(name)
            start.append(max(a, 0.0))
            information.append(whole)
            score.append(right)
    prior = prior_information(problem, columns, True)
    pull = -prior * off_nominal(problem, columns, point)
    return Blocks(
        tuple(problem.names[p] for p in columns.parameter),
        columns.scale,
        tuple(record),
        np.array(start),
        np.array(information),
        np.array(score),
        prior,
        pull,
        np.maximum(columns.record, 0),
    )


def _assembled(problem: Problem, weights: Weights, point: Point, local, scales):
    """Return the normal equations of the pieces, without those whose derivatives
    diverge.

    Dry friction that is larger than expected makes the steps of a piece unstable: its
    motion remains bounded, but its derivatives do not.
    """

    def equations(weights):
        extras = problem.weighted(weights)
        given = problem.layout, problem.pieces, extras, point, local, scales
        return assemble(*given)[0]

    found = equations(weights)
    wild = (weights.flown > 0) & _diverging(problem, np.asarray(found.ss))
    if not np.any(wild):
        return found
    return equations(Weights(np.where(wild, 0.0, weights.flown), weights.rested))


def _diverging(problem: Problem, ss: np.ndarray) -> np.ndarray:
    """Return the pieces whose information on their own state, of shape `(r, k, n, n)`,
    is not finite or far exceeds that of the samples and joints of a usual piece.
    """
    sharp = problem.extras.sharpness
    piece = np.asarray(sharp.piece)
    joints = np.minimum(np.asarray(sharp.flight), np.asarray(sharp.impact))
    usual = 1 / piece**2 + 1 / np.min(joints, axis=1, keepdims=True) ** 2
    known = np.abs(np.diagonal(ss, axis1=-2, axis2=-1))
    # an unlimited or unknown error of a state (NaN) gives no limit
    large = np.any(known > _DIVERGED * usual, axis=-1)
    return large | ~np.all(np.isfinite(ss), axis=(-2, -1))


def bounded(*arrays: np.ndarray) -> bool:
    """Return whether all numbers are finite, even in products."""
    return all(bool(np.all(np.abs(one) < _LARGEST)) for one in arrays)


def _usable(information: np.ndarray, score: np.ndarray) -> bool:
    """Return whether the numbers are bounded and the information is positive
    semidefinite, except for rounding errors.
    """
    if not bounded(information, score):
        return False
    if not score.size:
        return True
    least, *_, largest = np.linalg.eigvalsh(information)[[0, -1]]
    return bool(least >= -_ROUNDING * largest)


def values_of(found: Fit, blocks: Blocks) -> np.ndarray:
    """Return the parameter values of blocks at a fit, in units of their scales."""
    all_names = found.problem.names
    columns = [all_names.index(name) for name in blocks.names]
    return np.asarray(found.point.values)[blocks.owner, columns] / blocks.scale


def moved(
    problem: Problem,
    blocks: Blocks,
    values: Float[Array, "r q"],
    rows: Int[np.ndarray, " m"],
    step: Float[np.ndarray, " m"],
) -> Float[Array, "r q"]:
    """Return parameter values after a step of some parameters of the blocks, in units
    of their scales.
    """
    after = np.array(values)
    for row, change in zip(rows, step * blocks.scale[rows]):
        name = blocks.names[row]
        # a parameter with a value for each recording has a row for each
        shared = blocks.names.count(name) == 1
        owner = slice(None) if shared else blocks.owner[row]
        after[owner, problem.names.index(name)] += change
    return jnp.asarray(after)
