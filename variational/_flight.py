"""Integrate one flight (or one contact interval) and its variational equations."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid.runge_kutta import adaptive_steps, DOPRI8


# relative and absolute tolerance of the end state and the matrix entries
TOLERANCE = 1e-14


class LinearisedFlight(NamedTuple):
    """The end of a flight and its derivatives with respect to the start."""

    state: Float[Array, " n"]
    """State at the end, (n,)."""
    matrix: Float[Array, "n columns"]
    """Derivatives (n, n + q) with respect to the initial state, then the q
    parameters.
    """
    log_volume: Float[Array, ""]
    """Logarithm of the determinant of the first n columns, from Liouville's formula."""


def fly_linearised(
    field: Callable, parameters: Float[Array, " q"], t0, x, t1
) -> LinearisedFlight:
    """Integrate the motion and its variational equations from `t0` to `t1`.

    **Arguments:** `field(parameters, t, x)`, which must be smooth on the interval;
    there is no event detection.
    """
    n, q = x.shape[0], parameters.shape[0]

    def rates(t, y):
        state, matrix = y[:n], y[n:-1].reshape(n, n + q)
        by_state = jax.jacfwd(lambda s: field(parameters, t, s))(state)
        change = by_state @ matrix
        if q:
            by_parameter = jax.jacfwd(lambda p: field(p, t, state))(parameters)
            change = change.at[:, n:].add(by_parameter)
        rate, volume = field(parameters, t, state), jnp.trace(by_state)
        return jnp.concatenate([rate, change.ravel(), volume[None]])

    start = jnp.concatenate([x, jnp.eye(n, n + q).ravel(), jnp.zeros(1)])
    end = adaptive_steps(DOPRI8, rates, t0, start, t1, TOLERANCE)
    return LinearisedFlight(end[:n], end[n:-1].reshape(n, n + q), end[-1])
