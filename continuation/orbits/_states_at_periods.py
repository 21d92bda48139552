"""Compute the states of an orbit at integer multiples of the forcing period."""

from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import flow


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
