"""Select the varying parameter in a tree of parameters."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxcam.parameters import pick as parameter_pick, Where


def pick_one(where: Where, parameters: PyTree) -> tuple[int, str]:
    """Return the index of the leaf selected by `where`, and its name.

    Raises:
        ValueError: `where` selects nothing, or not a single number.
    """
    # parameters of bifurcation problems are often given as integers
    picked = parameter_pick(where, parameters, integers=True)
    if picked.several:
        raise ValueError(
            f"where selects {', '.join(picked.names)}, but a branch has one "
            "parameter, as in `lambda p: p.speed`"
        )
    return picked.leaves[0], picked.names[0]


def as_arguments(parameters: PyTree, *leaves: int) -> PyTree:
    """Return the parameters with floats and the selected leaves as float64 arrays, so
    that they become arguments of compiled programs instead of constants.
    """
    flat, structure = jax.tree.flatten(parameters)
    for i, leaf in enumerate(flat):
        number = isinstance(leaf, float | np.floating | np.ndarray)
        if i in leaves or number:
            flat[i] = np.asarray(leaf, jnp.result_type(leaf, float))
    return jax.tree.unflatten(structure, flat)


def as_jax(parameters: PyTree) -> PyTree:
    """Return the parameters with NumPy arrays, such as one varied by a branch, as JAX
    arrays.
    """

    def converted(leaf):
        return jnp.asarray(leaf) if isinstance(leaf, np.ndarray) else leaf

    return jax.tree.map(converted, parameters)


def leaf_of(parameters: PyTree, index: int):
    """Return the leaf with this index."""
    return jax.tree.leaves(parameters)[index]


def with_leaf(parameters: PyTree, index: int, value: Any) -> PyTree:
    """Return the parameters with one of them replaced."""
    flat, structure = jax.tree.flatten(parameters)
    flat[index] = value
    return jax.tree.unflatten(structure, flat)
