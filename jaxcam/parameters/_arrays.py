"""Convert floats to arrays, so that they are program arguments instead of constants."""

from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np


_Tree = TypeVar("_Tree")


def as_arrays(tree: _Tree) -> _Tree:
    """Return the same tree with every Python or NumPy float as a float64 array.

    A field declared as `stiffness: float = 3.0` is then an ordinary parameter.
    Arrays, traced values, integers and flags are unchanged.

    Args:
        tree: Any pytree.

    Returns:
        The tree with its floats as arrays.

    Examples:
        >>> from jaxcam.parameters import as_arrays
        >>> as_arrays({"mass": 0.5})["mass"].shape
        ()
    """
    return jax.tree.map(_as_array, tree)


def _as_array(leaf):
    if isinstance(leaf, float | np.floating):
        return jnp.asarray(leaf, jnp.float64)
    return leaf
