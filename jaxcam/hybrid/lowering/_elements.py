"""Arrays of scalars: numpy arrays of objects, which are traced or known numbers."""

import jax.numpy as jnp
import numpy as np

from ._scalars import forced, Memory


def split(array) -> np.ndarray:
    """Return an array as a numpy array of scalars."""
    shape = jnp.shape(array)
    out = np.empty(shape, dtype=object)
    for index in np.ndindex(shape):
        # a zero-dimensional numpy array becomes a number, which counts as known
        whole = not shape and not isinstance(array, np.ndarray)
        out[index] = array if whole else array[index]
    return out


def join(elements: np.ndarray):
    """Return the inverse of `split`."""
    if elements.shape == ():
        return jnp.asarray(elements[()])
    flat = [jnp.asarray(e) for e in elements.ravel()]
    return jnp.stack(flat).reshape(elements.shape)


def traced(elements: np.ndarray, memory: Memory) -> np.ndarray:
    """Return an array of scalars that have been traced, or are known."""
    out = np.empty(elements.shape, dtype=object)
    for index in np.ndindex(elements.shape):
        out[index] = forced(elements[index], memory)
    return out


def boxed(leaf) -> np.ndarray:
    if isinstance(leaf, np.ndarray) and leaf.dtype == object:
        return leaf
    out = np.empty((), dtype=object)
    out[()] = leaf
    return out
