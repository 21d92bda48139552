"""A force that is free at every node of every piece of flight, and what data say of it.

Whatever acts in flight is, to first order, a sum of these. So one linearisation tells
what any number of forces would gain.
"""

from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ..fitting import Problem
from ..fitting._fit import free_columns, off_nominal, prior_information
from ..fitting._linear import Linear, linear
from ..fitting._linearise import Point
from ._term import Motion, Term
from ._with_terms import WithTerms


class LocalForce(Term):
    """A force given at times `start + k spacing`, linear between them."""

    name: ClassVar[str] = "local_force"
    sentence: ClassVar[str] = "a force at one time"
    listed: ClassVar[bool] = False
    force: Float[Array, " k"]
    start: Float[Array, ""]
    spacing: Float[Array, ""]

    def acceleration(self, motion: Motion):
        place = (motion.t - self.start) / self.spacing
        away = jnp.abs(place - jnp.arange(self.force.shape[0], dtype=float))
        return jnp.maximum(0.0, 1.0 - away) @ self.force


class Response(NamedTuple):
    """What the pieces of all records say of a force at their nodes.

    - `pieces`: `Linear`, with `n` columns for the state, `m` for the parameters and
        then `l` for the force at the nodes, of each record.
    - `place` `(r, m)`: which of the `g` free numbers each parameter of a record is.
    - `time` `(r, k, l)`: of the nodes. `exists` `(r, k)`.
    - `prior`, `pull` `(g,)`: what the tolerances add to information and score.
    """

    pieces: Linear
    place: Int[np.ndarray, "r m"]
    time: Float[np.ndarray, "r k l"]
    exists: Float[np.ndarray, "r k"]
    prior: Float[np.ndarray, " g"]
    pull: Float[np.ndarray, " g"]


def force_response(problem: Problem, point: Point, free: tuple[str, ...]) -> Response:
    """Linearise about a point, with some parameters free and a force at every node.

    The nodes are where the steps of the flights evaluate their field.
    """
    columns = free_columns(problem, free)
    steps = problem.pieces.angle.shape[-1]
    found = _linear(
        problem.layout,
        problem.pieces,
        problem.weighted(None),
        point,
        jnp.asarray(columns.local),
        jnp.asarray(columns.scales),
        2 * steps + 1,
    )
    part = problem.pieces.flown
    half = np.asarray(part.step)[..., None] / 2
    prior = prior_information(problem, columns, True)
    return Response(
        jax.tree.map(np.asarray, found),
        columns.place,
        np.asarray(part.start)[..., None] + half * np.arange(2 * steps + 1),
        np.asarray(problem.pieces.exists),
        prior,
        -prior * off_nominal(problem, columns, point),
    )


@eqx.filter_jit
def _linear(layout, pieces, extras, point, columns, scales, nodes) -> Linear:
    def record(pieces, extras, values, states, columns, scales):
        size = columns.shape[0]

        def model_at(change, start, step):
            model = layout.at(values.at[columns].add(change[:size] * scales))
            force = LocalForce(change[size:], start, step / 2)
            system = WithTerms(model.system.base, (*model.system.terms, force))
            return eqx.tree_at(lambda m: m.system, model, system)

        return linear(model_at, pieces, extras, states, size + nodes)

    return jax.vmap(record)(pieces, extras, *point, columns, scales)
