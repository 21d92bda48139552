"""The Jacobian of a problem."""

import jax
from jaxtyping import Array, Float, PyTree

from ..problem import AbstractProblem


def jacobian_of(problem: AbstractProblem, u: Float[Array, " n"], parameters: PyTree):
    """Return dG/du, shape (n, n)."""
    return jax.jacfwd(problem.residual)(u, parameters)
