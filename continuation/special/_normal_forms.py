"""Compute normal-form coefficients at special points (Kuznetsov, chapters 3 to 5)."""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid.programs import program

from .._context import Context
from .._padding import as_compiled
from .._parameter import with_leaf
from .._program import Corrected, evaluate
from ..problem import AbstractProblem
from ._differences import along, STEPS
from ._multilinear import second, third
from ._test_functions import FLIP, FOLD, has_own_dynamics, HOPF, NEIMARK_SACKER


# largest displacement of a state component or phase for finite differences
_REACH = 2.0**-7


@program
def _b(problem, parameters, u, a, b, of_residual: bool):
    if of_residual:
        return second(lambda u: problem.residual(u, parameters), u, a, b)
    local = problem.local_dynamics(u, parameters)
    return second(local.motion, local.at, a, b)


@program
def _c(problem, parameters, u, a, b, c):
    local = problem.local_dynamics(u, parameters)
    return third(local.motion, local.at, a, b, c)


@program
def _jacobians(problem, parameters, u, moves):
    """Return the Jacobian of the local map at displacements from a solution."""
    local = problem.local_dynamics(u, parameters)
    return jax.vmap(lambda move: local.jacobian(local.at + move))(moves)


def _parts(x: Any):
    """Return the real vectors of which x consists, each with its factor 1 or 1j."""
    if np.isrealobj(x):
        return [(1.0, x)]
    return [(1.0, x.real), (1j, x.imag)]


class _Derivatives:
    """The first, second and third derivatives A, B and C of a problem at a point, also
    for complex arguments.

    They are computed by nested differentiation, or from differences of Jacobians if the
    problem sets `costly`.
    """

    def __init__(self, problem: AbstractProblem, context: Context, z: np.ndarray):
        self.problem = problem
        self.context = context
        self.z = z
        self.parameters = with_leaf(
            problem.parameters, context.leaf, jnp.asarray(z[-1])
        )
        self.u = jnp.asarray(z[:-1])

    def a(self, at: Corrected) -> np.ndarray:
        if not has_own_dynamics(self.problem):
            return at.linearisation
        y = jax.eval_shape(
            lambda u: self.problem.local_dynamics(u, self.parameters).at, self.u
        )
        # as many displacements as for differences, so that the same program is used
        return self._jacobians(np.zeros((2 * STEPS + 1, y.size)))[0]

    def b(self, x, y, of_residual: bool = False):
        total = 0.0
        for f, a in _parts(x):
            for g, b in _parts(y):
                total = total + f * g * self._b(a, b, of_residual)
        return total

    def c(self, x, y, w):
        total = 0.0
        for f, a in _parts(x):
            for g, b in _parts(y):
                for h, c in _parts(w):
                    total = total + f * g * h * self._c(a, b, c)
        return total

    def _b(self, a, b, of_residual: bool) -> np.ndarray:
        if self.problem.costly:
            return self._along(a, of_residual)[0] @ b
        return np.asarray(
            _b(
                self.problem, self.parameters, self.u,
                jnp.asarray(a), jnp.asarray(b), of_residual,
            )
        )  # fmt: skip

    def _c(self, a, b, c) -> np.ndarray:
        if self.problem.costly:
            # by polarisation, because differences give derivatives along one line only
            if np.array_equal(a, b):
                return self._along(a)[1] @ c
            return (self._along(a + b)[1] - self._along(a - b)[1]) @ c / 4
        return np.asarray(
            _c(
                self.problem, self.parameters, self.u,
                jnp.asarray(a), jnp.asarray(b), jnp.asarray(c),
            )
        )  # fmt: skip

    def _along(self, direction, of_residual: bool = False):
        """Compute the first and second derivative of the Jacobian along a real
        direction.
        """
        length = float(np.max(np.abs(direction)))
        if length == 0:
            n = direction.size
            return np.zeros((n, n)), np.zeros((n, n))
        reach = _REACH / length
        matrices = self._residual_jacobians if of_residual else self._jacobians
        first, again = along(matrices, reach * direction)
        return first / reach, again / reach**2

    def _jacobians(self, moves: np.ndarray) -> np.ndarray:
        problem, u = as_compiled(self.problem, self.u)
        return np.asarray(_jacobians(problem, self.parameters, u, moves))

    def _residual_jacobians(self, moves: np.ndarray) -> np.ndarray:
        """Return Jacobians from the program of the corrector, which is already
        compiled.
        """
        n, one = moves.shape[1], np.ones_like(self.z)
        return np.stack(
            [
                evaluate(
                    self.problem, self.context, self.z + np.append(move, 0.0), one
                ).jacobian[:, :n]
                for move in moves
            ]
        )


def _critical_pair(a: np.ndarray, distance: Callable) -> tuple[Any, Any] | None:
    """Return the eigenvalue of the complex pair for which `distance` is smallest, and
    its unit eigenvector; None if all eigenvalues are real.
    """
    found: Any = np.linalg.eig(a)
    values, vectors = (x.astype(complex) for x in found)
    critical = values.imag > 0
    if not np.any(critical):
        return None
    k = int(np.argmin(np.where(critical, distance(values), np.inf)))
    return values[k], vectors[:, k] / np.linalg.norm(vectors[:, k])


def _adjoint(matrix: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return the left null vector p with <p, q> = 1."""
    _, p = null_vectors(matrix)
    return p / np.conj(np.vdot(p, q))


def null_vectors(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit right and left null vectors of a nearly singular matrix."""
    left, _, right = np.linalg.svd(matrix)
    return right[-1].conj(), left[:, -1]


def flip_direction(linearisation: np.ndarray) -> np.ndarray:
    """Return the unit eigenvector of the multiplier -1."""
    return null_vectors(linearisation + np.eye(linearisation.shape[0]))[0]


def fold_form(d: _Derivatives, at: Corrected) -> tuple[float | None, str]:
    """Return the coefficient a of x' = a x^2 or x -> x + a x^2, and the side on which
    the branch lies.
    """
    n, jacobian, problem = at.jacobian.shape[0], at.jacobian, d.problem
    right, left = null_vectors(jacobian[:, :n])
    bending = float(left @ d.b(right, right, True))
    slope = float(left @ jacobian[:, n])
    if slope == 0 or not np.isfinite(bending):
        return None, ""
    side = "larger" if -bending / slope > 0 else "smaller"
    words = f"the branch lies at {side} parameter values"
    if problem.stability == "none":
        return None, words
    if has_own_dynamics(problem):
        a = d.a(at)
        right, left = null_vectors(a - np.eye(a.shape[0]))
        bending = float(left @ d.b(right, right))
    overlap = float(left @ right)
    if abs(overlap) < 1e-12:
        return None, words
    return bending / 2 / overlap, words


def flip_form(d: _Derivatives, at: Corrected) -> tuple[float | None, str]:
    """Return the coefficient c of x -> -x + c x^3; if it is positive, the
    period-doubled orbit is stable.
    """
    a = d.a(at)
    one = np.eye(a.shape[0])
    right, left = null_vectors(a + one)
    left = left / (left @ right)
    inner = np.linalg.solve(a - one, d.b(right, right))
    c = float(left @ (d.c(right, right, right) - 3 * d.b(right, inner))) / 6
    return c, "supercritical" if c > 0 else "subcritical"


def hopf_form(d: _Derivatives, at: Corrected) -> tuple[float | None, str]:
    """Return the first Lyapunov coefficient; if negative, the limit cycle is stable."""
    a = d.a(at)
    one = np.eye(a.shape[0])
    pair = _critical_pair(a, lambda values: np.abs(values.real))
    if pair is None:
        return None, ""
    value, q = pair
    omega = float(value.imag)
    p = _adjoint(a - 1j * omega * one, q)
    qc = q.conj()
    total = (
        np.vdot(p, d.c(q, q, qc))
        - 2 * np.vdot(p, d.b(q, np.linalg.solve(a + 0j, d.b(q, qc))))
        + np.vdot(p, d.b(qc, np.linalg.solve(2j * omega * one - a, d.b(q, q))))
    )
    c = float(total.real) / (2 * omega)
    return c, "supercritical" if c < 0 else "subcritical"


def neimark_sacker_form(d: _Derivatives, at: Corrected) -> tuple[float | None, str]:
    """Return the real part of the cubic coefficient; if it is negative, the invariant
    curve is stable.
    """
    a = d.a(at)
    one = np.eye(a.shape[0])
    pair = _critical_pair(a, lambda values: np.abs(np.abs(values) - 1))
    if pair is None:
        return None, ""
    value, q = pair
    turn = value / abs(value)
    p = _adjoint(a - turn * one, q)
    qc = q.conj()
    total = (
        np.vdot(p, d.c(q, q, qc))
        + 2 * np.vdot(p, d.b(q, np.linalg.solve(one - a + 0j, d.b(q, qc))))
        + np.vdot(p, d.b(qc, np.linalg.solve(turn**2 * one - a, d.b(q, q))))
    )
    c = float((total / turn).real) / 2
    return c, "supercritical" if c < 0 else "subcritical"


_FORMS = {
    FOLD: fold_form,
    FLIP: flip_form,
    HOPF: hopf_form,
    NEIMARK_SACKER: neimark_sacker_form,
}


def normal_form(
    kind: str,
    problem: AbstractProblem,
    context: Context,
    z: np.ndarray,
    at: Corrected,
) -> tuple[float | None, str]:
    """Return the normal-form coefficient of a special point, and the meaning of its
    sign.
    """
    if kind not in _FORMS or (kind != FOLD and not problem.normal_forms):
        return None, ""
    try:
        coefficient, words = _FORMS[kind](_Derivatives(problem, context, z), at)
    except np.linalg.LinAlgError:
        return None, ""
    if coefficient is not None and not np.isfinite(coefficient):
        return None, ""
    return coefficient, words
