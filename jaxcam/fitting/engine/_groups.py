"""Evaluate the pieces of a recording in groups, and skip groups of padding."""

import math
from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool


# Maximum number of pieces in a group, whose values fit into the cache of a core
_GROUP = 64


def in_groups(
    function: Callable, exists: Bool[Array, " k"], empty: Any, *arrays: Any
) -> Any:
    """Apply a function to each of `k` pieces, as `jax.vmap` does.

    Groups without an existing piece are skipped, except within `jax.vmap`, where a
    condition computes both sides. The groups have the same size, a divisor of `k`.

    Args:
        function: A function of the arrays of one piece.
        exists: Whether each piece exists, or is padding.
        empty: The result for a piece in a group that is skipped, of the same types and
            shapes as the results of `function`.
        arrays: Arrays, or pytrees of them, with the pieces along the first axis.

    Returns:
        The results, with the pieces along the first axis.
    """
    size = math.gcd(len(exists), _GROUP)

    def grouped(array):
        return array.reshape(-1, size, *array.shape[1:])

    def group(given):
        exists, arrays = given
        return jax.lax.cond(
            jnp.any(exists),
            lambda: jax.vmap(function)(*arrays),
            lambda: jax.tree.map(
                lambda a: jnp.broadcast_to(a, (size, *a.shape)), empty
            ),
        )

    found = jax.lax.map(group, jax.tree.map(grouped, (exists, arrays)))
    return jax.tree.map(lambda a: a.reshape(-1, *a.shape[2:]), found)
