"""Find a state of rest at which no constraint is penetrated."""

import jax
import jax.numpy as jnp
import numpy as np

from ._normal import gaps


# largest number of corrections, and the factor by which each moves the state too far
_CORRECTIONS, _FURTHER = 20, 1.001


def rest_state(system, t0, n: int) -> np.ndarray | None:
    """Return the zero state of n components or, if that violates a constraint at time
    t0, a state near it that violates none; None if no such state is found.
    """
    state, time = jnp.zeros(n), jnp.asarray(float(t0))
    for _ in range(_CORRECTIONS):
        gap = gaps(system, time, state)
        if not gap.shape[0] or float(jnp.min(gap)) >= 0:
            return np.asarray(state)
        which = int(jnp.argmin(gap))
        slope = jax.grad(lambda x, w=which: gaps(system, time, x)[w])
        normal = slope(state)
        state = state - _FURTHER * gap[which] * normal / jnp.sum(normal * normal)
    return None
