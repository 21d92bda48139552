"""Limit cycles of smooth vector fields, by shooting."""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxcam.hybrid.runge_kutta import DOPRI8, fixed_steps

from ._point import with_field
from .problem import AbstractProblem, StabilityKind, Start
from .special import FLIP, flip_direction


class LimitCycle(AbstractProblem):
    """Periodic orbits of u' = vector_field(u, parameters) with unknown period.

    The unknowns are (u(0), period). The equations are u(period) = u(0) and a phase
    condition: u(0) lies in a hyperplane, which is updated at each point of a branch.
    The multipliers are those of the return map to that hyperplane (thesis, eq. 2.14),
    without the trivial one.

    Examples:
        >>> import continuation
        >>> def field(u, p):
        ...     turned = jnp.stack([-u[1], u[0]])
        ...     return p["mu"] * u + turned - u * (u @ u)
        >>> problem = continuation.LimitCycle(field, {"mu": 1.0}, [1.0, 0.0])
        >>> state = jnp.array([1.0, 0.0, 2 * jnp.pi])
        >>> float(abs(problem.residual(state, {"mu": 1.0})).max()) < 1e-9
        True
    """

    vector_field: Callable[[Array, Any], Array]
    """Function of a state `(n,)`, n >= 2, and the parameters that returns `(n,)`."""
    parameters: PyTree
    """The parameters: any pytree with scalar floats among its leaves."""
    reference: Any
    """Initial reference: a state on or near the cycle, `(n,)`."""
    normal: Any
    """Unit normal of the hyperplane, `(n,)`."""
    basis: Any
    """Unit vectors in the hyperplane, `(n, n-1)`."""
    steps: int = eqx.field(static=True)
    """Number of equal eighth-order Dormand-Prince steps per period.
    `point.observed["error"]` is the largest estimated error of a step, relative to the
    state.
    """
    stability: ClassVar[StabilityKind] = "map"
    """Multipliers on the unit circle mark bifurcations."""
    normal_forms: ClassVar[bool] = False
    """No normal-form coefficients are computed."""

    def __init__(
        self,
        vector_field: Callable[[Any, Any], Array],
        parameters: PyTree,
        reference: Any,
        steps: int = 64,
        normal: Any = None,
    ):
        self.vector_field = vector_field
        self.parameters = parameters
        self.reference = np.asarray(reference, float)
        if self.reference.ndim != 1 or self.reference.size < 2:
            raise ValueError("reference must be a state of shape (n,), n >= 2")
        if steps < 1:
            raise ValueError(f"steps is {steps}; give a whole number >= 1")
        self.steps = steps
        if normal is None:
            normal = vector_field(jnp.asarray(self.reference), parameters)
        self.normal, self.basis = _plane(np.asarray(normal))

    def _turn(self, u, parameters):
        """Return the state after one period, and the largest error of a step."""
        x, period = u[:-1], u[-1]
        _, states, errors = fixed_steps(
            DOPRI8,
            lambda _, x: self.vector_field(x, parameters),
            jnp.zeros_like(period),
            x,
            period,
            self.steps,
        )
        return states[-1], jnp.max(jnp.abs(errors))

    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        x = u[:-1]
        phase = jnp.dot(self.normal, x - self.reference)
        closing = self._turn(u, parameters)[0] - x
        return jnp.concatenate([closing, phase[None]])

    def linearisation(self, u: Float[Array, " n"], parameters: PyTree, jacobian):
        n = u.shape[0] - 1
        monodromy = jacobian[:n, :n] + jnp.eye(n, dtype=u.dtype)
        f = self.vector_field(u[:-1], parameters)
        along = jnp.outer(f, self.normal) / jnp.dot(self.normal, f)
        on_plane = monodromy @ self.basis
        return self.basis.T @ (on_plane - along @ on_plane)

    def seen(self, u: Float[Array, " n"], parameters: PyTree):
        size = jnp.maximum(1.0, jnp.max(jnp.abs(u[:-1])))
        error = self._turn(u, parameters)[1] / size
        return {}, {"period": u[-1], "error": error}

    def refreshed(self, u: np.ndarray, parameters: PyTree) -> "LimitCycle":
        x = np.asarray(u[:-1], float)
        f = np.asarray(self.vector_field(jnp.asarray(x), parameters))
        # the field vanishes near a Hopf point: keep the plane derived at that point
        if np.linalg.norm(f) < 1e-6 * max(1.0, float(np.linalg.norm(x))):
            return self
        normal, basis = _plane(f)
        # keep the sign of the normal, so that the test functions are continuous
        normal = normal * (-1.0 if normal @ np.asarray(self.normal) < 0 else 1.0)
        moved = with_field(with_field(self, "normal", normal), "basis", basis)
        return with_field(moved, "reference", x)

    def check(self, point: Any) -> str | None:
        if point.state[-1] <= 0:
            return "the period is not positive"
        return None

    def transition(self, point: Any, at: Any) -> Start | None:
        if point.kind != FLIP:
            return None
        direction = flip_direction(at.linearisation)
        twice = with_field(self, "steps", 2 * self.steps)
        state = np.append(point.state[:-1], 2 * point.state[-1])
        tangent = np.concatenate([np.asarray(self.basis) @ direction, [0.0, 0.0]])
        return Start(twice, state, point.parameter, tangent)

    @property
    def signature(self) -> str:
        return f"limit cycle of {self.steps} steps"

    def with_signature(self, signature: str) -> AbstractProblem:
        words = signature.split()
        if words[:3] != ["limit", "cycle", "of"] or not words[3].isdecimal():
            return super().with_signature(signature)
        return with_field(self, "steps", int(words[3]))


def _plane(normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the unit normal, and unit vectors (n, n-1) in the plane perpendicular to
    it.
    """
    if not np.all(np.isfinite(normal)) or not np.any(normal):
        raise ValueError(
            "the vector field vanishes at the reference, which is an equilibrium and "
            "not a cycle; give a state on the cycle"
        )
    normal = normal / np.linalg.norm(normal)
    rows = np.linalg.svd(normal[None, :])[2]
    return normal, rows[1:].T


def cycle_at_hopf(
    vector_field: Callable, parameters: PyTree, point: Any, matrix: np.ndarray
) -> Start | None:
    """Return the start of the branch of cycles that emerges at a Hopf point, with
    radius 0 and period 2 pi / omega; None if the matrix has no complex eigenvalues.
    """
    found = np.linalg.eig(matrix)
    values: Any = found.eigenvalues
    vectors: Any = found.eigenvectors
    upper = values.imag > 0
    if not np.any(upper):
        return None
    k = int(np.argmin(np.where(upper, np.abs(values.real), np.inf)))
    q = vectors[:, k]
    # choose the phase for which the real and imaginary parts are orthogonal
    q = q * np.exp(-0.5j * np.angle(np.sum(q * q)))
    problem = LimitCycle(vector_field, parameters, point.state, normal=q.imag)
    state = np.append(point.state, 2 * np.pi / values[k].imag)
    tangent = np.concatenate([q.real / np.linalg.norm(q.real), [0.0, 0.0]])
    return Start(problem, state, point.parameter, tangent)
