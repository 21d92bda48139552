"""Compute branch points as regular solutions of an extended problem."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxcam.hybrid.programs import program
from jaxcam.parameters import AnyArray

from .._context import Context
from .._parameter import with_leaf
from .._program import evaluate, residual_at, solve
from ..problem import AbstractProblem, StabilityKind
from ._jacobian import jacobian_of


# displacement for finite-difference second derivatives, for unknowns of size one: their
# error only slows the iteration down, because the equations themselves are exact
_DISPLACED = 2.0**-15
# largest slack at a branch point, which may not be zero because of integration errors
_SLACK = 1e-10
# maximum number of corrections
_MOST = 30


class BranchPoints(AbstractProblem):
    """Simple branch points, with the unknowns (u, parameter, slack, left null vector).

    The 2 n + 2 equations are G + slack psi = 0, psi' G_u = 0, psi' G_p = 0 and psi' psi
    = 1. The solution is regular if two branches cross at an angle (Kuznetsov, Elements
    of Applied Bifurcation Theory, section 10.2).
    """

    base: AbstractProblem
    leaf: int = eqx.field(static=True)
    width: AnyArray
    stability: ClassVar[StabilityKind] = "none"

    @property
    def parameters(self) -> PyTree:
        return self.base.parameters

    def residual(self, u: Float[Array, " n"], parameters: PyTree):
        n = (u.shape[0] - 2) // 2
        inner, p, slack, psi = u[:n], u[n], u[n + 1], u[n + 2 :]

        def g(inner, p):
            return self.base.residual(inner, with_leaf(parameters, self.leaf, p))

        value = g(inner, p)
        j_u = jacobian_of(self.base, inner, with_leaf(parameters, self.leaf, p))
        _, j_p = jax.jvp(lambda p: g(inner, p), (p,), (jnp.ones_like(p),))
        rest = jnp.stack([psi @ j_p, psi @ psi - 1.0])
        return jnp.concatenate([value + slack * psi, psi @ j_u, rest])

    def scale(self, u: Float[Array, " n"], parameters: PyTree):
        n = (u.shape[0] - 2) // 2
        sizes = self.base.scale(u[:n], with_leaf(parameters, self.leaf, u[n]))
        ones = jnp.ones(n + 1, u.dtype)
        return jnp.concatenate([sizes, jnp.reshape(self.width, (1,)), ones])


# `parameters` is a property, but type checkers take it for a constructor argument
_crossing: Any = BranchPoints


def solved_crossing(
    problem: AbstractProblem, context: Context, guess
) -> tuple[np.ndarray, bool]:
    """Return the branch point near z = (u, parameter), found by Newton's method with
    second derivatives, and whether the method succeeded.
    """
    at = _at(problem, context, guess)
    if not np.all(np.isfinite(at.jacobian)):
        return guess, False
    left, _, _ = np.linalg.svd(at.jacobian * at.scale[None, :])
    extended = _crossing(problem, context.leaf, np.asarray(context.width))
    u = np.concatenate([guess, [0.0], left[:, -1]])
    value, success, _ = solve(extended, u, context.settings)
    k = guess.size
    return value[:k], success and _solves(value[k], context)


def differenced_crossing(
    problem: AbstractProblem, context: Context, guess
) -> tuple[np.ndarray, bool]:
    """Return the branch point, found with differences of Jacobians from the corrector's
    program, and whether the iteration succeeded.

    The second derivatives are computed only once. Convergence is linear, and fast near
    the branch point, where bracketing ends because the equations are singular.
    """
    guess = np.asarray(guess, float)
    at = _at(problem, context, guess)
    if not np.all(np.isfinite(at.jacobian)):
        return guess, False
    # rows and columns are scaled as in the corrector
    n, scale = guess.size - 1, np.asarray(at.scale)
    rows = scale[:-1, None]

    def jacobian(y):
        found = _at(problem, context, y * scale)
        return found.jacobian * scale[None, :] / rows

    y, psi, slack = guess / scale, np.linalg.svd(jacobian(guess / scale))[0][:, -1], 0.0
    moves = _DISPLACED * np.eye(n + 1)
    curvature = np.stack(
        [(jacobian(y + m) - jacobian(y - m)).T @ psi / (2 * _DISPLACED) for m in moves]
    ).T
    for _ in range(_MOST):
        j = jacobian(y)
        g = np.asarray(_residual(problem, context.leaf, y * scale)) / rows[:, 0]
        wrong = np.concatenate([g + slack * psi, j.T @ psi, [psi @ psi - 1.0]])
        matrix = np.zeros((2 * n + 2, 2 * n + 2))
        matrix[:n, : n + 1], matrix[:n, n + 1] = j, psi
        matrix[:n, n + 2 :] = slack * np.eye(n)
        matrix[n:-1, : n + 1], matrix[n:-1, n + 2 :] = curvature, j.T
        matrix[-1, n + 2 :] = 2 * psi
        if not np.all(np.isfinite(matrix)) or not np.all(np.isfinite(wrong)):
            return guess, False
        change = np.linalg.lstsq(matrix, -wrong, rcond=None)[0]
        y, slack = y + change[: n + 1], slack + float(change[n + 1])
        psi = psi + change[n + 2 :]
        if np.linalg.norm(change[: n + 1]) <= context.settings.tolerance:
            return y * scale, _solves(slack, context)
    return y * scale, False


def _solves(slack, context: Context) -> bool:
    """Return whether the point solves the original equations, not only those with
    slack.
    """
    return bool(abs(slack) <= max(context.settings.tolerance, _SLACK))


def _at(problem, context: Context, z):
    return evaluate(problem, context, z, np.ones_like(z))


@program
def _residual(problem, leaf: int, z):
    return residual_at(problem, leaf, z)
