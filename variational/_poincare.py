"""Linearise the Poincaré map of a smooth flow."""

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
    """Return the derivative of the Poincaré map at a point of a periodic motion.

    It is the monodromy matrix projected onto the section along the flow (thesis, eq.
    2.14). Its eigenvalues are the nontrivial multipliers of the orbit and a zero, which
    belongs to the direction of the flow.

    Args:
        field: Vector field of an autonomous system, `field(state)`.
        section: Smooth scalar function of the state that is zero on the section.
        state: A state on the section and on the orbit, shape `(n,)`.
        period: Period of the orbit (s).
        tolerance: Relative error allowed per step.

    Returns:
        Shape `(n, n)`.

    Examples:
        >>> from variational import poincare_derivative
        >>> def field(x):
        ...     growth = 1 - x @ x
        ...     return jnp.stack([growth * x[0] - x[1], growth * x[1] + x[0]])
        >>> state, period = jnp.array([1.0, 0.0]), 2 * jnp.pi
        >>> m = poincare_derivative(field, lambda x: x[1], state, period)
        >>> round(float(m[0, 0]) / float(jnp.exp(-4 * jnp.pi)), 4)
        1.0
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
