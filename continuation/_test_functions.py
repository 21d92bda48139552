"""Test functions: they change sign at special points."""

from typing import Any

import numpy as np

from ._bialternate import pairs
from ._problem import AbstractProblem
from ._program import Corrected


FOLD = "fold"
BRANCH_POINT = "branch point"
FLIP = "flip"
NEIMARK_SACKER = "Neimark-Sacker"
HOPF = "Hopf"


def kinds(problem: AbstractProblem) -> tuple[str, ...]:
    """Special points that are looked for, besides those of the problem's monitors."""
    if not problem.detects:
        return ()
    common = (BRANCH_POINT, FOLD)
    more = {"equilibrium": (HOPF,), "map": (FLIP, NEIMARK_SACKER), "none": ()}
    return common + more[problem.stability]


def test_values(problem: AbstractProblem, at: Corrected) -> dict[str, float]:
    """Values of all test functions at a point.

    Those of eigenvalues are symmetric in them, products over all eigenvalues or pairs
    (as the determinant of a bialternate product is), so none has to be followed. Only
    their signs are used; the size is that of the smallest factor.
    """
    values = {name: float(value) for name, value in at.monitors.items()}
    wanted = kinds(problem)
    if BRANCH_POINT in wanted:
        values[BRANCH_POINT] = float(at.determinant)
        values[FOLD] = float(at.tangent[-1] / at.scale[-1])
    if FLIP in wanted or HOPF in wanted:
        eigenvalues = eigenvalues_of(at.linearisation)
        i, j = pairs(eigenvalues.size)
        if HOPF in wanted:
            values[HOPF] = _product(eigenvalues[i] + eigenvalues[j])
        if FLIP in wanted:
            values[FLIP] = _product(eigenvalues + 1)
            values[NEIMARK_SACKER] = _product(eigenvalues[i] * eigenvalues[j] - 1)
    return values


def _product(factors: np.ndarray) -> float:
    """A number with the sign of the (real) product."""
    sizes = np.abs(factors)
    if not factors.size or not np.all(sizes > 0):
        return 0.0
    product: Any = np.prod(factors / sizes)
    return float(np.sign(product.real) * sizes.min())


def eigenvalues_of(matrix: np.ndarray) -> Any:
    """Eigenvalues, largest modulus first; NaN where the matrix is not finite."""
    if not np.all(np.isfinite(matrix)):
        return np.full(matrix.shape[0], np.nan, complex)
    values: Any = np.linalg.eigvals(matrix).astype(complex)
    return values[np.lexsort((values.imag, values.real, -np.abs(values)))]


def is_stable(problem: AbstractProblem, eigenvalues: Any) -> bool | None:
    """Whether all eigenvalues are on the stable side; None where that means nothing."""
    if problem.stability == "none" or not np.all(np.isfinite(eigenvalues)):
        return None
    if problem.stability == "map":
        return bool(np.all(np.abs(eigenvalues) < 1))
    return bool(np.all(eigenvalues.real < 0))
