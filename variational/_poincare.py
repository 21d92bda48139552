"""The linearised Poincare map of a smooth flow."""

from collections.abc import Callable

import diffrax
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


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
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(lambda t, y, args: field(y)),
            diffrax.Dopri8(),
            0.0,
            period,
            None,
            x,
            stepsize_controller=diffrax.PIDController(rtol=tolerance, atol=tolerance),
            adjoint=diffrax.ForwardMode(),
            max_steps=100_000,
        )
        assert solution.ys is not None
        return solution.ys[-1]

    monodromy = jax.jacfwd(flow)(state)
    along, normal = field(state), jax.grad(section)(state)
    projector = jnp.eye(state.shape[0]) - jnp.outer(along, normal) / (normal @ along)
    return projector @ monodromy
