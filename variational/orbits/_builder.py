"""Create a system from the values of some of its parameters."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.parameters import Pick


def picked(system, where: Pick | None) -> Float[Array, " q"]:
    """Return the selected parameters as one vector."""
    if where is None:
        return jnp.zeros(0)
    leaves = jax.tree.leaves(where(system))
    return jnp.stack([jnp.asarray(leaf, dtype=jnp.float64) for leaf in leaves])


def builder(system, where: Pick | None) -> Callable:
    """Return the function that creates the prepared system from a parameter vector."""

    def build(values):
        if where is None:
            return system.prepared()
        numbers = [values[i] for i in range(values.shape[0])]
        return where.replaced(system, *numbers).prepared()

    return build
