"""Linearise the predictions of the recordings with respect to a force that is free at
every node of every flight.

To first order, every effect in flight is a sum of such forces. One linearisation
therefore predicts the gains of any number of forces, without compiling a program for
each.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ...fitting import engine, Problem
from ...fitting.engine import (
    each_record,
    eliminate_states,
    free_columns,
    linear_pieces,
    LinearPieces,
    of_record,
    off_nominal,
    Point,
    prior_information,
    shows_directly,
    with_begins,
)
from ...hybrid.programs import program
from ...parameters import FloatScalar
from ..terms import Motion, Term
from ._blocks import Blocks, bounded
from ._motion_of_pieces import motion_of_pieces


# Number of nodes of a force in a piece, minus one: two per step, or fewer if steps are
# short
_NODES = 20


class LocalForce(Term):
    """A force given at times `start + k * spacing`, interpolated linearly."""

    name: ClassVar[str] = "local_force"
    sentence: ClassVar[str] = "a force at one time"
    listed: ClassVar[bool] = False
    force: Float[Array, " k"]
    start: FloatScalar
    spacing: FloatScalar

    def acceleration(self, motion: Motion):
        place = (motion.t - self.start) / self.spacing
        away = jnp.abs(place - jnp.arange(self.force.shape[0], dtype=float))
        return jnp.maximum(0.0, 1.0 - away) @ self.force


class Response(NamedTuple):
    """The response of the pieces of all recordings to a force at their nodes.

    - `point`: the point of linearisation; `free`: names of the free parameters.
    - `pieces`: `LinearPieces` of each recording, with `n` columns for the state, `m`
        for the parameters and `l` for the force at the nodes.
    - `place` `(r, m)`: for each parameter of a recording, its index among the `g` free
      parameters.
    - `motion`: motion at the nodes, `(r, k, l)` each. `exists` `(r, k)`: false where
        padded.
    - `names`, `scale`, `prior`, `pull`, `owner` `(g,)`: names and scales of the free
        parameters, the contributions of their tolerances to the information and the
        score, and the recording to which they belong.
    """

    point: Point
    free: tuple[str, ...]
    pieces: LinearPieces
    place: Int[np.ndarray, "r m"]
    motion: Motion
    exists: Bool[np.ndarray, "r k"]
    names: tuple[str, ...]
    scale: Float[np.ndarray, " g"]
    prior: Float[np.ndarray, " g"]
    pull: Float[np.ndarray, " g"]
    owner: Int[np.ndarray, " g"]

    @property
    def time(self) -> Float[np.ndarray, "r k l"]:
        """Times of the nodes."""
        return self.motion.t


def stride_of(problem: Problem) -> int:
    """Return the number of half steps between nodes of a force.

    Steps may be shorter than the time scale of a force requires, because of a measured
    input or of errors that accumulate over a flight of many pieces.
    """
    halves = 2 * problem.pieces.steps
    stride = max(1, halves // _NODES)
    return stride if halves % stride == 0 else 1


def force_response(problem: Problem, point: Point, free: Sequence[str]) -> Response:
    """Linearise about a point, with some parameters free and a force at every node.

    A recording whose motion diverges at the point says nothing about forces. The nodes
    are the times at which the integration steps evaluate the vector field, or every
    `stride`-th of these times.
    """
    columns = free_columns(problem, free)
    stride = stride_of(problem)
    nodes = 2 * problem.pieces.steps // stride + 1
    local, scales = jnp.asarray(columns.local), jnp.asarray(columns.scales)
    shown = shows_directly(problem.layout, problem.pieces, local, scales)
    extras = problem.weighted(None)
    every = with_begins(problem.pieces, point), extras, point.states, local, scales

    def record(row):
        values, one = of_record((point.values, every), row)
        return _linear(problem.layout.about(values), *one, nodes, stride, shown)

    args = problem.layout, of_record((point.values, every), 0), nodes, stride, shown
    found = each_record(record, len(columns.place), (_linear, args))
    moved = motion_of_pieces(problem.layout, problem.pieces, point)
    # copies, because a view would keep the motion at all nodes
    at_nodes = jax.tree.map(lambda a: np.asarray(a)[:, :, ::stride].copy(), moved)
    prior = prior_information(problem, columns, True)
    return Response(
        point,
        tuple(free),
        _without_diverging(jax.tree.map(np.asarray, found)),
        columns.place,
        at_nodes,
        np.asarray(problem.pieces.exists),
        tuple(problem.names[p] for p in columns.parameter),
        columns.scale,
        prior,
        -prior * off_nominal(problem, columns, point),
        np.maximum(columns.record, 0),
    )


def _without_diverging(found: LinearPieces) -> LinearPieces:
    """Return the linear pieces `(r, k, ...)`; those of recordings whose derivatives
    diverge are zero.
    """
    # costs are not part of the normal equations, and may be unknown
    numbers = found._replace(flown_cost=None, joint_cost=None, rested_cost=None)
    parts = jax.tree.leaves(numbers)
    keep = np.array([bounded(*each) for each in zip(*parts)])
    if np.all(keep):
        return found

    def kept(part):
        return np.where(keep.reshape(-1, *[1] * (part.ndim - 1)), part, 0.0)

    return jax.tree.map(kept, found)


def force_blocks(
    problem: Problem, response: Response, terms: Sequence[Term], decoy: bool = False
) -> Blocks:
    """Return the score and the information of the free parameters and of terms that
    act in flight.

    **Arguments:** terms that are not in the problem, are linear in their strengths, and
    act on the first coordinate; the rows of their strengths follow those of the free
    parameters, in order. As a `decoy`, the terms act at the wrong times: they
    are reversed in time.
    """
    strengths = [p for k, term in enumerate(terms) for p in term.parameters(k)]
    scale = np.array([p.scale for p in strengths], dtype=float)
    forces = forces_at_nodes(response, terms) * scale
    if decoy:
        forces = _in_reverse(response, forces)
    return blocks_at_nodes(
        problem, response, forces, [p.name for p in strengths], scale
    )


def blocks_at_nodes(
    problem: Problem,
    response: Response,
    forces: Float[np.ndarray, "r k l p"],
    names: Sequence[str],
    scale: Float[np.ndarray, " p"],
) -> Blocks:
    """Return the score and the information of the free parameters and of forces given
    at the nodes of every piece.

    **Arguments:** the accelerations for a change of each strength by its scale, and the
    names and scales of the strengths.
    """
    width, size = forces.shape[-1], len(response.prior)
    each = [_chained(response, r, some) for r, some in enumerate(forces)]
    chain = jax.tree.map(lambda *parts: np.stack(parts), *each)
    found = jax.tree.map(np.asarray, eliminate_states(chain))
    information, score = [], []
    total = size + width
    for r, place in enumerate(response.place):
        used = np.flatnonzero(place >= 0)
        rows = np.concatenate([place[used], size + np.arange(width)])
        local = np.concatenate([used, len(place) + np.arange(width)])
        whole, right = np.zeros((total, total)), np.zeros(total)
        whole[np.ix_(rows, rows)] = found.information[r][np.ix_(local, local)]
        right[rows] = found.score[r][local]
        if not bounded(whole, right):
            whole, right = np.zeros_like(whole), np.zeros_like(right)
        information.append(whole)
        score.append(right)
    none = np.zeros(width)
    return Blocks(
        (*response.names, *names),
        np.concatenate([response.scale, scale]),
        problem.records,
        np.zeros(len(problem.records)),
        np.array(information),
        np.array(score),
        np.concatenate([response.prior, none]),
        np.concatenate([response.pull, none]),
        np.concatenate([response.owner, np.zeros(width, dtype=int)]),
    )


def _in_reverse(
    response: Response, forces: Float[np.ndarray, "r k l p"]
) -> Float[np.ndarray, "r k l p"]:
    """Return the forces of each recording, reversed in time."""
    found = forces.copy()
    for row, exists in enumerate(response.exists):
        rows = np.flatnonzero(exists)
        found[row, rows] = forces[row, rows[::-1], ::-1]
    return found


def forces_at_nodes(
    response: Response, terms: Sequence[Term]
) -> Float[np.ndarray, "r k l p"]:
    """Return the acceleration per unit of each strength of the given terms, at every
    node.
    """
    return np.asarray(_slopes(tuple(terms), response.motion))


def _chained(
    response: Response, r: int, forces: Float[np.ndarray, "k l p"]
) -> engine.Blocks:
    """Return the normal equations of one recording, with a few given forces instead of
    a free one at each node.

    The blocks of the forces are summed over the pieces at once, because those of every
    piece would need gigabytes of memory.
    """
    found: LinearPieces = jax.tree.map(lambda part: part[r], response.pieces)
    n, m = found.later.shape[-1], response.place.shape[1]
    inner, slope, later = found.information, found.slope, found.later
    earlier, off = found.earlier[..., :n], found.tied[..., None]
    across = inner[..., n + m :] @ forces
    # the residual of a joint depends on the forces in the piece before it
    before = np.concatenate([np.zeros_like(forces[:1]), forces[:-1]])
    pushed = found.earlier[..., n + m :] @ before
    moved = found.direct[..., :m] + found.earlier[..., n : n + m]
    params = np.concatenate([moved, pushed], axis=-1)
    sides = np.swapaxes(later, -1, -2), np.swapaxes(earlier, -1, -2)

    def tied(rows):
        own, previous = (side @ rows for side in sides)
        return own + np.concatenate([previous[1:], np.zeros_like(previous[:1])])

    ss = inner[:, :n, :n] + sides[0] @ later
    ss[:-1] += (sides[1] @ earlier)[1:]
    sp = np.concatenate([inner[:, :n, n : n + m], across[:, :n]], axis=-1)
    flat = forces.reshape(-1, forces.shape[-1])
    corner = np.sum(across[:, n : n + m], axis=0)
    pp = np.block(
        [
            [found.pp[:m, :m] + np.sum(inner[:, n : n + m, n : n + m], axis=0), corner],
            [corner.T, flat.T @ across[:, n + m :].reshape(flat.shape)],
        ]
    )
    rows = params.reshape(-1, params.shape[-1])
    p = np.concatenate(
        [
            found.p[:m] + np.sum(slope[:, n : n + m], axis=0),
            flat.T @ slope[:, n + m :].ravel(),
        ]
    )
    parts: tuple[Any, ...] = (
        ss,
        sp + tied(params),
        slope[:, :n] - tied(off)[..., 0],
        sides[0] @ earlier,
        pp + rows.T @ rows,
        p - rows.T @ off.ravel(),
    )
    return engine.Blocks(*parts)


@program
def _linear(
    near, pieces, extras, states, columns, scales, nodes, stride, shown
) -> LinearPieces:
    """Linearise one recording, given its arrays."""
    size = columns.shape[0]
    near = near.by(columns, scales)

    def model_at(change, start, step):
        model = near.at(change[:size])
        force = LocalForce(change[size:], start, stride * step / 2)
        terms = *model.system.terms, force
        system = dataclasses.replace(model.system, terms=terms)
        return eqx.tree_at(lambda m: m.system, model, system)

    return linear_pieces(model_at, pieces, extras, states, size + nodes, shown)


@program
def _slopes(terms, motion: Motion) -> Float[Array, "r k l p"]:
    """Return the derivatives of the accelerations with respect to the strengths."""

    def total(terms, motion):
        return sum(term.acceleration(motion) for term in terms)

    def slopes(motion):
        found = eqx.filter_grad(total)(terms, motion)
        return jnp.stack([value for term in found for value in term.numbers()])

    flat = jax.tree.map(lambda part: part.reshape(-1, *part.shape[3:]), motion)
    found = jax.vmap(slopes)(jax.tree.map(jnp.asarray, flat))
    return found.reshape(*motion.t.shape, -1)
