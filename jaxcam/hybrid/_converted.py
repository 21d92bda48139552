"""Convert the floats of a system to arrays once for several runs."""

import operator
from typing import TypeVar

import jax
import numpy as np

from ..parameters import as_arrays
from .caches import Latest
from .programs import is_outermost


_Tree = TypeVar("_Tree")


class Converted:
    """The result of `as_arrays` for the latest tree.

    The same object is returned as long as the tree contains the same objects, so that
    later results that depend on it can be kept as well.
    """

    def __init__(self):
        self._latest = Latest()

    def of(self, tree: _Tree) -> _Tree:
        """Return the tree with its floats as arrays."""
        if not is_outermost():
            # arrays of an earlier call would become constants of the new program
            return as_arrays(tree)
        leaves = jax.tree.leaves(tree)
        known = self._latest.get(tree)
        if known is not None:
            old, result = known
            if len(old) == len(leaves) and all(map(operator.is_, old, leaves)):
                return result
        made = as_arrays(tree)
        # the elements of a NumPy array can change without notice
        if not any(isinstance(leaf, np.ndarray) for leaf in leaves):
            self._latest.keep(tree, (leaves, made))
        return made
