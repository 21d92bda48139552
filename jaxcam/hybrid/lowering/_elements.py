"""Arrays of scalars: numpy arrays of objects, which are traced or known numbers."""

from typing import no_type_check

import jax.numpy as jnp
import numpy as np

from ._known import is_known, join_known
from ._scalars import forced, Memory, Part


# arrays with more elements than this are kept whole: most of them are tables, of which
# an operation reads only a few elements
LONG = 64


def split(array) -> np.ndarray:
    """Return an array as a numpy array of scalars."""
    shape = jnp.shape(array)
    out = np.empty(shape, dtype=object)
    if out.size > LONG and not isinstance(array, np.ndarray):
        for index in np.ndindex(shape):
            out[index] = Part(array, index)
        return out
    for index in np.ndindex(shape):
        # a zero-dimensional numpy array becomes a number, which counts as known
        whole = not shape and not isinstance(array, np.ndarray)
        out[index] = array if whole else array[index]
    return out


def join(elements: np.ndarray):
    """Return the array that consists of these elements: the inverse of `split`."""
    if elements.shape == ():
        return jnp.asarray(elements[()])
    whole = _whole(elements)
    if whole is not None:
        return whole
    if elements.size and all(map(is_known, elements.ravel())):
        return jnp.asarray(join_known(elements))
    flat = [jnp.asarray(e) for e in elements.ravel()]
    return jnp.stack(flat).reshape(elements.shape)


@no_type_check
def _whole(elements: np.ndarray):
    """Return the long array that consists of exactly these elements, or `None`."""
    first = elements.flat[0] if elements.size else None
    if not isinstance(first, Part) or first.whole.shape != elements.shape:
        return None
    indices = zip(elements.ravel(), np.ndindex(elements.shape), strict=True)
    same = all(
        isinstance(e, Part) and e.whole is first.whole and e.index == index
        for e, index in indices
    )
    return first.whole if same else None


def join_traced(elements: np.ndarray, memory: Memory):
    """Return the array of these elements, tracing those that are not traced yet."""
    whole = _whole(elements)
    return join(traced(elements, memory)) if whole is None else whole


def traced(elements: np.ndarray, memory: Memory) -> np.ndarray:
    """Return these elements as an array of scalars that are all traced or known."""
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
