"""Compute eigenvalues in a fixed order."""

from typing import Any

import numpy as np


def eigenvalues_of(matrix: np.ndarray) -> Any:
    """Return eigenvalues, largest modulus first; NaN if the matrix is not finite."""
    if not np.all(np.isfinite(matrix)):
        return np.full(matrix.shape[0], np.nan, complex)
    values: Any = np.linalg.eigvals(matrix).astype(complex)
    return values[np.lexsort((values.imag, values.real, -np.abs(values)))]
