"""Evaluate the test functions, which change sign at special points."""

from typing import Any

import numpy as np

from .._parameter import with_leaf
from .._program import Corrected
from ..problem import AbstractProblem
from ._bialternate import pairs


FOLD = "fold"
BRANCH_POINT = "branch point"
FLIP = "flip"
NEIMARK_SACKER = "Neimark-Sacker"
HOPF = "Hopf"
_HUGE = 1e100
"""Represents an infinite eigenvalue in products."""


def kinds(problem: AbstractProblem) -> tuple[str, ...]:
    """Return the kinds of special points detected in addition to zeros of monitors."""
    if not problem.detects:
        return ()
    common = (BRANCH_POINT, FOLD)
    more = {"equilibrium": (HOPF,), "map": (FLIP, NEIMARK_SACKER), "none": ()}
    return common + more[problem.stability]


def has_own_dynamics(problem: AbstractProblem) -> bool:
    """Return whether a problem overrides `local_dynamics`, so that its normal forms and
    its linearisation belong to different maps.
    """
    return type(problem).local_dynamics is not AbstractProblem.local_dynamics


def test_values(problem: AbstractProblem, leaf: int, at: Corrected) -> dict[str, float]:
    """Return the values of all test functions at a point.

    Test functions of eigenvalues are symmetric: they are products over all eigenvalues
    or pairs (such as the determinant of a bialternate product), so no single eigenvalue
    has to be tracked. Only their signs are used; the magnitude is that of the smallest
    factor.
    """
    values = {name: float(value) for name, value in at.monitors.items()}
    wanted = kinds(problem)
    if BRANCH_POINT in wanted:
        values[BRANCH_POINT] = float(at.determinant)
        values[FOLD] = float(at.tangent[-1] / at.scale[-1])
    if FLIP in wanted or HOPF in wanted:
        eigenvalues, _ = eigenvalues_at(problem, leaf, at)
        # only signs matter, and that of an infinite multiplier is known
        huge = np.isinf(eigenvalues)
        eigenvalues = np.where(huge, np.sign(eigenvalues.real) * _HUGE, eigenvalues)
        i, j = pairs(eigenvalues.size)
        if HOPF in wanted:
            values[HOPF] = _product(eigenvalues[i] + eigenvalues[j])
        if FLIP in wanted:
            values[FLIP] = _product(eigenvalues + 1)
            values[NEIMARK_SACKER] = _product(eigenvalues[i] * eigenvalues[j] - 1)
    return values


def _product(factors: np.ndarray) -> float:
    """Return a number with the sign of the product, which is real, and the modulus of
    the smallest factor.
    """
    sizes = np.abs(factors)
    if not factors.size or not np.all(sizes > 0):
        return 0.0
    product: Any = np.prod(factors / sizes)
    return float(np.sign(product.real) * sizes.min())


def eigenvalues_at(
    problem: AbstractProblem, leaf: int, at: Corrected
) -> tuple[Any, str]:
    """Return the eigenvalues at a point of a branch, and a remark on them."""
    parameters = with_leaf(problem.parameters, leaf, np.asarray(at.z[-1]))
    return problem.eigenvalues(at.z[:-1], parameters, at)


def is_stable(problem: AbstractProblem, eigenvalues: Any) -> bool | None:
    """Return whether all eigenvalues are on the stable side; None if stability is not
    computed or an eigenvalue is not finite.
    """
    if problem.stability == "none" or not np.all(np.isfinite(eigenvalues)):
        return None
    if problem.stability == "map":
        return bool(np.all(np.abs(eigenvalues) < 1))
    return bool(np.all(eigenvalues.real < 0))
