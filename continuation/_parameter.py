"""Picking the parameter that varies out of any tree of parameters."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree


class _Marker:
    """Stands in for a leaf while `where` runs."""

    def __init__(self, index: int):
        self.index = index


def pick(where: Callable[[Any], Any], parameters: PyTree) -> tuple[int, str]:
    """Index of the leaf that `where` picks, and its name.

    **Raises:** `ValueError` where it picks nothing, or not a single number.
    """
    pairs, structure = jax.tree_util.tree_flatten_with_path(parameters)
    names = [
        jax.tree_util.keystr(path, simple=True, separator=".") or "parameter"
        for path, _ in pairs
    ]
    numbers = [
        name for name, (_, leaf) in zip(names, pairs, strict=True) if _is_number(leaf)
    ]
    known = ", ".join(numbers) or "none"
    marked = jax.tree.unflatten(structure, [_Marker(i) for i in range(len(pairs))])
    try:
        marker = where(marked)
    except (AttributeError, KeyError, IndexError, TypeError) as error:
        raise ValueError(
            f"where picks a parameter that does not exist ({error}); the parameters "
            f"are: {known}"
        ) from error
    if not isinstance(marker, _Marker) or not _is_number(pairs[marker.index][1]):
        raise ValueError(
            "where must pick one scalar parameter, as in `lambda p: p.speed`; the "
            f"parameters are: {known}"
        )
    return marker.index, names[marker.index]


def _is_number(leaf: Any) -> bool:
    if isinstance(leaf, bool):
        return False
    if isinstance(leaf, int | float | np.number):
        return True
    return isinstance(leaf, jax.Array | np.ndarray) and leaf.shape == ()


def as_arrays(parameters: PyTree, *leaves: int) -> PyTree:
    """Floats, and the picked leaves, as float64 arrays: arguments of programs."""
    flat, structure = jax.tree.flatten(parameters)
    for i, leaf in enumerate(flat):
        number = isinstance(leaf, float | np.floating | np.ndarray)
        if i in leaves or number:
            flat[i] = np.asarray(leaf, jnp.result_type(leaf, float))
    return jax.tree.unflatten(structure, flat)


def leaf_of(parameters: PyTree, index: int):
    """The leaf with this index."""
    return jax.tree.leaves(parameters)[index]


def with_leaf(parameters: PyTree, index: int, value: Any) -> PyTree:
    """The same parameters, one of them replaced."""
    flat, structure = jax.tree.flatten(parameters)
    flat[index] = value
    return jax.tree.unflatten(structure, flat)
