"""Normal-form coefficients at special points (Kuznetsov, chapters 3 to 5)."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._multilinear import second, third
from ._parameter import with_leaf
from ._problem import AbstractProblem
from ._program import Corrected
from ._test_functions import FLIP, FOLD, HOPF, NEIMARK_SACKER


def _around(problem, u, parameters):
    motion, y = problem.local_motion(u, parameters)
    return (lambda y, _: motion(y)), y


@eqx.filter_jit
def _a(problem, parameters, u):
    motion, y = problem.local_motion(u, parameters)
    return jax.jacfwd(motion)(y)


@eqx.filter_jit
def _b(problem, parameters, u, a, b, of_residual: bool):
    if of_residual:
        return second(problem.residual, u, parameters, a, b)
    motion, y = _around(problem, u, parameters)
    return second(motion, y, None, a, b)


@eqx.filter_jit
def _c(problem, parameters, u, a, b, c):
    motion, y = _around(problem, u, parameters)
    return third(motion, y, None, a, b, c)


def _parts(x: Any):
    """Real vectors and their factors that make up a complex vector."""
    if np.isrealobj(x):
        return [(1.0, x)]
    return [(1.0, x.real), (1j, x.imag)]


class _Derivatives:
    """A, B and C of a problem at a point, for complex arguments too."""

    def __init__(self, problem: AbstractProblem, leaf: int, z: np.ndarray):
        self.problem = problem
        self.parameters = with_leaf(problem.parameters, leaf, jnp.asarray(z[-1]))
        self.u = jnp.asarray(z[:-1])

    def a(self, at: Corrected) -> np.ndarray:
        if type(self.problem).local_motion is AbstractProblem.local_motion:
            return at.linearisation
        return np.asarray(_a(self.problem, self.parameters, self.u))

    def b(self, x, y, of_residual: bool = False):
        total = 0.0
        for f, a in _parts(x):
            for g, b in _parts(y):
                value = _b(
                    self.problem,
                    self.parameters,
                    self.u,
                    jnp.asarray(a),
                    jnp.asarray(b),
                    of_residual,
                )
                total = total + f * g * np.asarray(value)
        return total

    def c(self, x, y, w):
        total = 0.0
        for f, a in _parts(x):
            for g, b in _parts(y):
                for h, c in _parts(w):
                    value = _c(
                        self.problem,
                        self.parameters,
                        self.u,
                        jnp.asarray(a),
                        jnp.asarray(b),
                        jnp.asarray(c),
                    )
                    total = total + f * g * h * np.asarray(value)
        return total


def _eigen(matrix: np.ndarray) -> tuple[Any, Any]:
    """Complex eigenvalues and eigenvectors."""
    values, vectors = np.linalg.eig(matrix)
    return values.astype(complex), vectors.astype(complex)


def null_vectors(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unit right and left null vectors of a nearly singular matrix."""
    left, _, right = np.linalg.svd(matrix)
    return right[-1].conj(), left[:, -1]


def fold_form(problem, leaf, z, at: Corrected) -> tuple[float | None, str]:
    """Coefficient a of x' = a x^2 or x -> x + a x^2, and where the branch opens."""
    n = z.size - 1
    d = _Derivatives(problem, leaf, z)
    jacobian = at.jacobian
    right, left = null_vectors(jacobian[:, :n])
    bending = float(left @ d.b(right, right, True))
    slope = float(left @ jacobian[:, n])
    if slope == 0 or not np.isfinite(bending):
        return None, ""
    side = "larger" if -bending / slope > 0 else "smaller"
    words = f"the branch lies at {side} parameters"
    if problem.stability == "none":
        return None, words
    if type(problem).local_motion is not AbstractProblem.local_motion:
        a = d.a(at)
        right, left = null_vectors(a - np.eye(a.shape[0]))
        bending = float(left @ d.b(right, right))
    overlap = float(left @ right)
    if abs(overlap) < 1e-12:
        return None, words
    return bending / 2 / overlap, words


def flip_form(problem, leaf, z, at: Corrected) -> tuple[float | None, str]:
    """Coefficient c of x -> -x + c x^3; positive: the doubled orbit is stable."""
    d = _Derivatives(problem, leaf, z)
    a = d.a(at)
    one = np.eye(a.shape[0])
    right, left = null_vectors(a + one)
    left = left / (left @ right)
    inner = np.linalg.solve(a - one, d.b(right, right))
    c = float(left @ (d.c(right, right, right) - 3 * d.b(right, inner))) / 6
    return c, "supercritical" if c > 0 else "subcritical"


def hopf_form(problem, leaf, z, at: Corrected) -> tuple[float | None, str]:
    """First Lyapunov coefficient; negative: the limit cycle is stable."""
    d = _Derivatives(problem, leaf, z)
    a = d.a(at)
    values, vectors = _eigen(a)
    critical = values.imag > 0
    if not np.any(critical):
        return None, ""
    k = int(np.argmin(np.where(critical, np.abs(values.real), np.inf)))
    omega = float(values[k].imag)
    q = vectors[:, k] / np.linalg.norm(vectors[:, k])
    _, p = null_vectors(a - 1j * omega * np.eye(a.shape[0]))
    p = p / np.conj(np.vdot(p, q))
    qc = q.conj()
    one = np.eye(a.shape[0])
    total = (
        np.vdot(p, d.c(q, q, qc))
        - 2 * np.vdot(p, d.b(q, np.linalg.solve(a + 0j, d.b(q, qc))))
        + np.vdot(p, d.b(qc, np.linalg.solve(2j * omega * one - a, d.b(q, q))))
    )
    c = float(total.real) / (2 * omega)
    return c, "supercritical" if c < 0 else "subcritical"


def neimark_sacker_form(problem, leaf, z, at: Corrected) -> tuple[float | None, str]:
    """Real part of the cubic coefficient; negative: the invariant curve is stable."""
    d = _Derivatives(problem, leaf, z)
    a = d.a(at)
    values, vectors = _eigen(a)
    critical = values.imag > 0
    if not np.any(critical):
        return None, ""
    k = int(np.argmin(np.where(critical, np.abs(np.abs(values) - 1), np.inf)))
    turn = values[k] / abs(values[k])
    q = vectors[:, k] / np.linalg.norm(vectors[:, k])
    one = np.eye(a.shape[0])
    _, p = null_vectors(a - turn * one)
    p = p / np.conj(np.vdot(p, q))
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
    kind: str, problem: AbstractProblem, leaf: int, z: np.ndarray, at: Corrected
) -> tuple[float | None, str]:
    """Normal-form coefficient of a special point, and what its sign says."""
    if kind not in _FORMS or (kind != FOLD and not problem.normal_forms):
        return None, ""
    try:
        coefficient, words = _FORMS[kind](problem, leaf, z, at)
    except np.linalg.LinAlgError:
        return None, ""
    if coefficient is not None and not np.isfinite(coefficient):
        return None, ""
    return coefficient, words
