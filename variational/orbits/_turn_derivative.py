"""Compute the derivatives of the state at the end of a period from the pieces of the
motion.
"""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import Settings
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import field_in_force

from .._flight import fly_linearised
from ._builder import builder
from ._period_map import derivatives_by_flow
from ._pieces import TurnPieces
from ._product import product_of, with_all_constraints


class TurnDerivative(eqx.Module):
    """Derivatives of the state at the end of one period."""

    state: Float[Array, "n n"]
    """Derivative with respect to the initial state, shape `(n, n)`: the monodromy
    matrix of a periodic orbit.
    """
    period: Float[Array, " n"]
    """Derivative with respect to the period, that is, to the end time, shape `(n,)`."""
    phase: Float[Array, " n"]
    """Derivative with respect to the start time at fixed period, shape `(n,)`."""
    parameters: Float[Array, "n q"]
    """Derivative with respect to the selected parameters at fixed times, shape `(n,
    q)`.
    """
    determinant: Float[Array, ""]
    """Determinant of `state`; zero if the motion sticks."""
    condition: Float[Array, ""]
    """Relative error of `state` per relative error in each flight and saltation matrix;
    NaN for the method "flow".
    """
    sticks: bool = eqx.field(static=True)
    """Whether there is sustained contact, which removes all memory of the past."""


@program
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


def by_flow(
    system, values, where, state, t0, period, settings: Settings, sticks: bool
) -> TurnDerivative:
    """Differentiate the event loop and return the derivatives over one period."""
    given = values, where, state, t0, period, settings
    made = derivatives_by_flow(system, *given)
    by_state, by_start, by_length, by_parameter = made
    return TurnDerivative(
        by_state,
        by_length,
        by_start,
        by_parameter,
        jnp.linalg.det(by_state),
        jnp.asarray(jnp.nan),
        sticks,
    )


@program
def flown(system, t0, state, t1) -> Float[Array, " n"]:
    """Return the final state of a flight without events."""
    system = system.prepared()
    return fly_linearised(
        lambda _, t, x: system.vector_field(t, x), jnp.zeros(0), t0, state, t1
    ).state
