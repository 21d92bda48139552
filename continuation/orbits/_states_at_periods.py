"""Compute the states of an orbit at integer multiples of the forcing period.

Each of them is computed from the start, because a state alone does not tell on which
side of a surface with hysteresis the motion is.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import flow
from jaxcam.hybrid.flow_jacobian import unchecked_flow


def states_at_periods(
    problem: Any, x, start, end, parameters
) -> Float[Array, "periods n"]:
    """Return the states of a `SingleShooting`, at the start of the period first."""
    if problem.periods == 1:
        return x[None]
    parts = jnp.arange(1, problem.periods, dtype=jnp.float64) / problem.periods

    def later(part):
        until = start + part * (end - start)
        return flow(parameters, x, start, until, settings=problem.settings).state

    return jnp.concatenate([x[None], jax.vmap(later)(parts)])


def states_outside_programs(
    problem: Any, x, start, end, parameters
) -> Float[np.ndarray, "periods n"]:
    """Return the same as `states_at_periods`, one simulation at a time."""
    states = [np.asarray(x)]
    for k in range(1, problem.periods):
        until = start + k / problem.periods * (end - start)
        made = unchecked_flow(parameters, x, start, until, problem.settings)
        states.append(np.asarray(made.state))
    return np.stack(states)
