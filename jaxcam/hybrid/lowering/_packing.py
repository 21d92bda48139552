"""Pack the arrays of a pytree into one array, because each argument of a call takes
time.
"""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np


class Packing(NamedTuple):
    """The structure of a packed pytree; it is hashable, so programs can be looked up by
    it.
    """

    structure: Any
    shapes: tuple
    """Shape of each leaf; `None` for a leaf that is not of 64-bit floats and remains
    separate.
    """

    def unpacked(self, numbers, apart):
        """Return the pytree of these numbers, `(k,)`, and of the separate leaves."""
        leaves, first, rest = [], 0, iter(apart)
        for shape in self.shapes:
            if shape is None:
                leaves.append(next(rest))
                continue
            last = first + math.prod(shape)
            leaves.append(numbers[first:last].reshape(shape))
            first = last
        return jax.tree.unflatten(self.structure, leaves)


class Packed(NamedTuple):
    """The arrays of a pytree; if batch elements differ, `numbers` has a column for
    each.
    """

    numbers: np.ndarray
    """Shape `(k,)` or `(k, elements)`."""
    apart: list
    """Leaves that are not 64-bit floats, with a row for each batch element."""
    packing: Packing

    def some(self, lanes) -> tuple:
        """Return the numbers and the other leaves of the given batch elements."""
        return self.numbers[:, lanes], [leaf[lanes] for leaf in self.apart]


def pack(tree, lanes: int | None = None) -> Packed:
    """Return the packed arrays of a pytree; with `lanes`, each array has a row per
    batch element.
    """
    leaves, structure = jax.tree.flatten(tree)
    plain = [leaf.dtype == jnp.float64 for leaf in leaves]
    floats = [np.asarray(leaf) for leaf, fits in zip(leaves, plain) if fits]
    number, head = (1, 0) if lanes is None else (lanes, 1)
    shapes = iter([array.shape[head:] for array in floats])
    rows = [array.reshape(number, -1).T for array in floats]
    numbers = np.concatenate([np.zeros((0, number)), *rows])
    numbers = numbers[:, 0] if lanes is None else numbers
    packing = Packing(
        structure, tuple(next(shapes) if fits else None for fits in plain)
    )
    apart = [leaf for leaf, fits in zip(leaves, plain) if not fits]
    return Packed(numbers, apart, packing)
