"""Compute the multipliers of an orbit at grazing, as limits from the impacting side."""

from typing import Any

import numpy as np
from jaxtyping import Complex, Float


def multipliers_at_grazing(
    regular: Float[np.ndarray, "n n"], singular: Float[np.ndarray, "n n"]
) -> Complex[np.ndarray, " n"]:
    """Return the eigenvalues of regular + singular / speed for speed -> 0 from below.

    Near grazing, the monodromy matrix has this form, and its second part has rank one,
    b c' (from `saltation_parts`, multiplied by the matrices of the flights and the
    other impacts). One multiplier grows like c'b / speed; the others tend to the
    eigenvalues of the first part restricted to the plane c'x = 0, projected onto it
    along b.

    **Arguments:** both parts, shape `(n, n)`; the speed is the normal velocity before
    the impact, below zero.

    Returns:
        Shape `(n,)`: plus or minus infinity and the n - 1 limits, largest modulus
            first; all NaN if c'b = 0, because the growth is then of a different order.
    """
    n = regular.shape[0]
    unknown = np.full(n, np.nan, complex)
    if not (np.all(np.isfinite(regular)) and np.all(np.isfinite(singular))):
        return unknown
    _, sizes, right = np.linalg.svd(singular)
    growth = float(np.trace(singular))
    # c'b = 0, to within rounding
    if not abs(growth) > 1e-9 * sizes[0]:
        return unknown
    plane = right[1:].T
    along = np.eye(n) - singular / growth
    others: Any = np.linalg.eigvals(plane.T @ along @ regular @ plane).astype(complex)
    others = others[np.lexsort((others.imag, others.real, -np.abs(others)))]
    return np.concatenate([[complex(-np.sign(growth) * np.inf, 0.0)], others])
