"""What the state at the end of a turn depends on, from its pieces."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid.surface import field_in_force
from jaxcam.parameters import Pick

from .._flight import fly_linearised
from ._pieces import TurnPieces
from ._product import product_of, with_all_constraints


class TurnDerivative(eqx.Module):
    """How the state at the end of a turn depends on what it started with."""

    state: Float[Array, "n n"]
    """(n, n) by the state at the start: the monodromy matrix of a periodic orbit."""
    period: Float[Array, " n"]
    """(n,) by the period, that is, by the time at which the turn ends."""
    phase: Float[Array, " n"]
    """(n,) by the time of the start, at the same length."""
    parameters: Float[Array, "n q"]
    """(n, q) by the parameters picked, at the same times."""
    determinant: Float[Array, ""]
    """Determinant of `state`; zero where the turn sticks."""
    condition: Float[Array, ""]
    """The relative error of `state` that a relative error of one in each flight and
    each saltation matrix makes."""
    sticks: bool = eqx.field(static=True)
    """Whether there is contact in the turn, which forgets what came before."""


def picked(system, where: Pick | None) -> Float[Array, " q"]:
    """The parameters picked, as one vector."""
    if where is None:
        return jnp.zeros(0)
    leaves = jax.tree.leaves(where(system))
    return jnp.stack([jnp.asarray(leaf, dtype=jnp.float64) for leaf in leaves])


def builder(system, where: Pick | None) -> Callable:
    """From a vector of parameters to the system, made cheap to evaluate."""

    def build(values):
        if where is None:
            return system.prepared()
        numbers = [values[i] for i in range(values.shape[0])]
        return where.replaced(system, *numbers).prepared()

    return build


@eqx.filter_jit
def by_product(system, values, where, state, pieces: TurnPieces, sticks):
    n = state.shape[0]
    build = builder(system, where)
    made = product_of(build, values, state, pieces, sticks)
    pieces = with_all_constraints(build(values), pieces, state)
    first, last = pieces.contact[0], pieces.contact[-1]
    rate = field_in_force(build(values), pieces.start[0], state, first)
    end_rate = field_in_force(build(values), pieces.end[-1], made.state, last)
    matrix = made.matrix[:, :n]
    return TurnDerivative(
        matrix,
        end_rate,
        end_rate - matrix @ rate,
        made.matrix[:, n:],
        made.determinant,
        made.condition,
        sticks,
    )


@eqx.filter_jit
def flown(system, t0, state, t1) -> Float[Array, " n"]:
    """The end of a flight that meets nothing."""
    system = system.prepared()
    return fly_linearised(
        lambda _, t, x: system.vector_field(t, x), jnp.zeros(0), t0, state, t1
    ).state
