"""The linearised Poincare map of a smooth flow."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid.runge_kutta import adaptive_steps, DOPRI8


def poincare_derivative(
    field: Callable,
    section: Callable,
    state: Float[Array, " n"],
    period,
    *,
    tolerance: float = 1e-11,
) -> Float[Array, "n n"]:
    """Derivative of the Poincare map at a point of a periodic motion. (2.14)

    The monodromy matrix, projected onto the section along the flow. It has one
    eigenvalue zero, in the direction of the flow, and the multipliers of the orbit.

    **Arguments:** an autonomous vector field and a section function of the state, both
    smooth; a state on the section and on the orbit, and the period (s).
    """

    def flow(x):
        start, end = jnp.zeros(()), jnp.asarray(period, dtype=float)
        return adaptive_steps(
            DOPRI8, lambda _, y: field(y), start, x, end, tolerance, 100_000
        )

    monodromy = jax.jacfwd(flow)(state)
    along, normal = field(state), jax.grad(section)(state)
    projector = jnp.eye(state.shape[0]) - jnp.outer(along, normal) / (normal @ along)
    return projector @ monodromy
