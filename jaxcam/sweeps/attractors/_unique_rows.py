"""Find the unique rows of a table."""

import numpy as np


def unique_rows(table) -> tuple[np.ndarray, np.ndarray]:
    """Return the unique rows of a table in order, and the index of each row.

    **Arguments:** a table of numbers, shape `(rows, columns)`; without columns, all
    rows are equal.

    Returns:
        The different rows, shape `(number, columns)`, and an index into them, shape
            `(rows,)`. The result is that of `numpy.unique(table, axis=0,
            return_inverse=True)`, which sorts rows as records and takes several times
            as long.
    """
    table = np.asarray(table)
    rows = np.arange(len(table))
    order = np.lexsort(table.T[::-1]) if table.shape[1] else rows
    inorder = table[order]
    new = np.ones(len(table), dtype=bool)
    new[1:] = np.any(inorder[1:] != inorder[:-1], axis=1)
    back = np.empty(len(table), dtype=int)
    back[order] = np.cumsum(new) - 1
    return inorder[new], back
