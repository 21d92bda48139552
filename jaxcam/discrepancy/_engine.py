"""Problems of `jaxcam.fitting` with terms, and what their scores say of blocks."""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ..fitting import Fit, Model, Problem, Weights
from ..fitting._columns import (
    free_columns,
    invert,
    off_nominal,
    prior_information,
)
from ..fitting._eliminate import eliminate, step_of
from ..fitting._fit import PROMISE, total_cost
from ..fitting._linearise import assemble, Layout, Point
from ..fitting._problem import _places
from ._term import Term
from ._with_terms import WithTerms


def extended(problem: Problem, terms: Sequence[Term], at: Point) -> Problem:
    """The same data with more terms in the system, all without effect so far.

    **Arguments:** a problem whose system is a `WithTerms`, the terms to add, and the
    point to start from.
    """
    system = problem.model.system
    assert isinstance(system, WithTerms)
    before = len(system.terms)
    model: Model = eqx.tree_at(
        lambda m: m.system,
        problem.model,
        WithTerms(system.base, (*system.terms, *terms)),
    )
    more = [p for k, t in enumerate(terms) for p in t.parameters(before + k)]
    parameters = (*problem.parameters, *more)
    layout = Layout(model, _places(model, parameters))
    fresh = np.array([float(p.where(model)) for p in more])
    fresh = np.tile(fresh, (len(problem.segments), 1))

    def wider(values):
        return jnp.asarray(np.concatenate([np.asarray(values), fresh], axis=1))

    return dataclasses.replace(
        problem,
        model=model,
        parameters=parameters,
        layout=layout,
        start=at._replace(values=wider(at.values)),
    )


# Part of its information that a parameter must keep beside the others to be seen
_ALIKE = 1e-8
# Part of what all records say of a combination that a half of them must say
_UNTOLD = 1e-3
# Steps of Newton's method on the states alone
_STATE_STEPS = 12


@dataclasses.dataclass(frozen=True)
class Blocks:
    """The likelihood about a point as a quadratic function, block by block.

    A block is a stretch of one record. In units of the parameters' scales, the states
    eliminated: `information` `(b, g, g)`, `score` `(b, g)`; `prior` `(g,)` and
    `pull` `(g,)` are what the tolerances add to both.
    """

    names: tuple[str, ...]
    scale: Float[np.ndarray, " g"]
    record: tuple[str, ...]
    start: Float[np.ndarray, " b"]
    information: Float[np.ndarray, "b g g"]
    score: Float[np.ndarray, "b g"]
    prior: Float[np.ndarray, " g"]
    pull: Float[np.ndarray, " g"]

    def rows(self, names) -> np.ndarray:
        wanted = set(names)
        return np.array([k for k, n in enumerate(self.names) if n in wanted], dtype=int)

    def total(self, weight=None):
        """Information and score of all blocks, weighted, with the tolerances."""
        weight = np.ones(len(self.record)) if weight is None else weight
        information = np.einsum("b,bij->ij", weight, self.information)
        score = np.einsum("b,bi->i", weight, self.score)
        return information + np.diag(self.prior), score + self.pull


def blocks_of(
    problem: Problem, point: Point, slices: int = 1, names: Sequence[str] | None = None
) -> Blocks:
    """Score and information of parameters about a point, in slices of each record."""
    columns = free_columns(problem, names)
    local, scales = jnp.asarray(columns.local), jnp.asarray(columns.scales)
    longest = max(part.recording.time[-1] for part in problem.segments)
    edges = np.linspace(0.0, longest, slices + 1)
    edges[0], edges[-1] = -np.inf, np.inf
    size = len(columns.scale)
    record, start, information, score = [], [], [], []
    for a, b in zip(edges, edges[1:]):
        weights = problem.between(a, b)
        found, _ = assemble(
            problem.layout,
            problem.pieces,
            problem.weighted(weights),
            point,
            local,
            scales,
        )
        found = eliminate(found)
        for r, (name, place) in enumerate(zip(problem.records, columns.place)):
            # a parameter with a value for each record has a row for each
            used = np.flatnonzero(place >= 0)
            rows = place[used]
            whole, right = np.zeros((size, size)), np.zeros(size)
            whole[np.ix_(rows, rows)] = np.asarray(found.information[r])[
                np.ix_(used, used)
            ]
            right[rows] = np.asarray(found.score[r])[used]
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
    )


def gain(information, score, rows) -> float:
    """Growth of twice the log-likelihood when some parameters are freed."""
    if not len(rows):
        return 0.0
    step, _ = off(information, score, rows)
    return float(score[rows] @ step)


def added(information, score, free, new) -> float:
    """Growth of twice the log-likelihood when `new` are freed beside `free`.

    Combinations that the free ones imitate to within `_ALIKE` of their information gain
    nothing, as rounding would decide what.
    """
    new = np.setdiff1d(new, free)
    if not len(new):
        return 0.0
    free = free[np.diag(information)[free] > 0]
    inside = invert(information[np.ix_(free, free)])
    across = information[np.ix_(new, free)]
    rest = information[np.ix_(new, new)] - across @ inside @ across.T
    left = score[new] - across @ (inside @ score[free])
    own = np.diag(information)[new]
    scale = 1 / np.sqrt(np.where(own > 0, own, np.inf))
    values, vectors = np.linalg.eigh(rest * np.outer(scale, scale))
    along = vectors.T @ (left * scale)
    seen = values > _ALIKE
    return float(np.sum(along[seen] ** 2 / values[seen]))


def foretold(blocks: Blocks, free, new) -> float:
    """Gain in twice the log-likelihood of records with what others say of `new`.

    They are dealt out to two halves, each foretells the other, and the sum is
    returned; the `free` parameters are fitted to either half. What differs from record
    to record, as the faults of a film do, gains where it is fitted and loses here.
    Infinite for one record, which can foretell nothing.
    """
    names = list(dict.fromkeys(blocks.record))
    if len(names) < 2:
        return np.inf
    information, score = blocks.total()
    free = free[np.diag(information)[free] > 0]
    new = np.setdiff1d(new, free)
    rest, _ = _beside(information, score, free, new, np.eye(len(new)))
    own = np.diag(information)[new]
    scale = 1 / np.sqrt(np.where(own > 0, own, np.inf))
    values, vectors = np.linalg.eigh(rest * np.outer(scale, scale))
    seen = values > _ALIKE
    # combinations that can be told from the free ones, each known to one unit
    basis = scale[:, None] * vectors[:, seen] / np.sqrt(values[seen])
    total = 0.0
    for half in (names[::2], names[1::2]):
        known = np.isin(blocks.record, half).astype(float)
        inside, pull = _beside(*blocks.total(known), free, new, basis)
        values, vectors = np.linalg.eigh(inside)
        told = values > _UNTOLD
        step = vectors[:, told] @ ((vectors[:, told].T @ pull) / values[told])
        inside, pull = _beside(*blocks.total(1 - known), free, new, basis)
        total += float(2 * step @ pull - step @ inside @ step)
    return total


def _beside(information, score, free, new, basis):
    """Information and score of combinations of `new`, the free ones eliminated."""
    free = free[np.diag(information)[free] > 0]
    inverse = invert(information[np.ix_(free, free)])
    across = basis.T @ information[np.ix_(new, free)]
    inside = basis.T @ information[np.ix_(new, new)] @ basis
    return (
        inside - across @ inverse @ across.T,
        basis.T @ score[new] - across @ (inverse @ score[free]),
    )


def off(information, score, rows):
    """Steps of some parameters to their optimum, and their covariance.

    What the data do not see at all stays where it is, with an infinite variance.
    """
    step = np.zeros(len(rows))
    covariance = np.diag(np.full(len(rows), np.inf))
    alive = np.flatnonzero(np.diag(information)[rows] > 0)
    inside = rows[alive]
    inverse = invert(information[np.ix_(inside, inside)])
    step[alive] = inverse @ score[inside]
    covariance[np.ix_(alive, alive)] = inverse
    return step, covariance


def value_of(found: Fit, name: str) -> float:
    return float(found.point.values[0, found.problem.names.index(name)])


def with_states(problem: Problem, found: Fit, weights: Weights) -> Fit:
    """The parameters of a fit and states fitted to other data, as in a test of them.

    The same programs as those of the fit itself are used: all parameters are free with
    a scale of zero.
    """
    columns = free_columns(problem, found.free)
    local = jnp.asarray(columns.local)
    scales = jnp.zeros(local.shape)
    extras, point = problem.weighted(weights), found.point
    none = jnp.zeros(local.shape)
    costs = found.costs
    best = np.inf
    for _ in range(_STATE_STEPS):
        blocks, costs_here = assemble(
            problem.layout, problem.pieces, extras, point, local, scales
        )
        total = total_cost(costs_here, extras)
        if total > best - PROMISE:
            break
        best, costs, kept = total, costs_here, point
        reduced = eliminate(blocks)
        point = point._replace(states=point.states + step_of(reduced, none))
    return dataclasses.replace(found, point=kept, cost=best, costs=costs)
