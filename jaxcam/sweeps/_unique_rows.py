"""Rows of a table that differ."""

import numpy as np


def unique_rows(table) -> tuple[np.ndarray, np.ndarray]:
    """The different rows of a table in order, and which of them each row is.

    As `numpy.unique(table, axis=0, return_inverse=True)`, but columns are sorted as
    numbers, not rows as strings of bytes, which takes most of the time of that.
    """
    table = np.asarray(table)
    order = np.lexsort(table.T[::-1])
    inorder = table[order]
    new = np.ones(len(table), dtype=bool)
    new[1:] = np.any(inorder[1:] != inorder[:-1], axis=1)
    back = np.empty(len(table), dtype=int)
    back[order] = np.cumsum(new) - 1
    return inorder[new], back
