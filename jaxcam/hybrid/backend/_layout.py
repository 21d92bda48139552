"""Positions of the arrays of a pytree in a vector of numbers."""

from typing import Any, NamedTuple

import jax
import numpy as np

from ._writer import kind_of, Lacking


# maximum number of values: each is read by an instruction of its own
_MOST = 4096


class Layout(NamedTuple):
    """Positions of the arrays of a pytree in a vector of numbers; hashable."""

    structure: Any
    shapes: tuple
    dtypes: tuple

    @property
    def size(self) -> int:
        return sum(int(np.prod(shape)) for shape in self.shapes)

    @staticmethod
    def of(tree) -> "Layout":
        """Return the layout of a pytree of arrays."""
        leaves, structure = jax.tree.flatten(tree)
        dtypes = tuple(np.dtype(leaf.dtype) for leaf in leaves)
        return Layout(structure, tuple(leaf.shape for leaf in leaves), dtypes)

    def tree(self, numbers):
        """Return the pytree of these numbers, `(*rows, size)`."""
        leaves, first, rows = [], 0, numbers.shape[:-1]
        for shape, dtype in zip(self.shapes, self.dtypes, strict=True):
            last = first + int(np.prod(shape))
            part = numbers[..., first:last].reshape((*rows, *shape))
            leaves.append(part.astype(dtype))
            first = last
        return jax.tree.unflatten(self.structure, leaves)


def laid_out(tree, lanes: int | None = None) -> tuple[np.ndarray, Layout]:
    """Return the arrays of a pytree as 64-bit floats, and their layout.

    The floats have shape `(size,)`; or, if the arrays have one row for each of `lanes`
    batch elements, `(elements, size)`.

    **Raises:** `Lacking` if an element is not a number, or if there are too many.
    """
    leaves, structure = jax.tree.flatten(tree)
    rows, shapes, dtypes = [], [], []
    number, head = (1, 0) if lanes is None else (lanes, 1)
    for array in leaves:
        # raises an error for a random key, which is also an array
        kind_of(array.dtype)
        leaf = np.asarray(array)
        floats = leaf.astype(np.float64)
        if leaf.dtype.kind in "iu" and np.any(np.abs(floats) > 2.0**53):
            raise Lacking("integers above 2^53")
        rows.append(floats.reshape(number, -1))
        shapes.append(leaf.shape[head:])
        dtypes.append(leaf.dtype)
    numbers = np.concatenate([np.zeros((number, 0)), *rows], axis=1)
    if numbers.shape[1] > _MOST:
        raise Lacking(f"systems of more than {_MOST} numbers")
    layout = Layout(structure, tuple(shapes), tuple(dtypes))
    return np.ascontiguousarray(numbers[0] if lanes is None else numbers), layout
