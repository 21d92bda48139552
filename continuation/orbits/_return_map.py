"""The derivative of the return map of an orbit without forcing."""

import jax.numpy as jnp
from jaxtyping import Array, Float


def on_hyperplane(
    matrix: Float[Array, "n n"], rate: Float[Array, " n"], normal: Float[Array, " n"]
) -> Float[Array, "k k"]:
    """Return the derivative of the map of a hyperplane to itself, shape `(n - 1, n -
    1)`.

    Args:
        matrix: The monodromy matrix, shape `(n, n)`.
        rate: Rate of change of the state at the start, shape `(n,)`.
        normal: Normal of the hyperplane, shape `(n,)`.
    """
    across = jnp.linalg.svd(normal[None])[2][1:].T
    moved = matrix @ across
    moved = moved - jnp.outer(rate, normal @ moved) / (normal @ rate)
    return across.T @ moved
