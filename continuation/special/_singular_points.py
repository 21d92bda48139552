"""Compute points with a singular matrix as regular solutions of an extended problem."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxcam.hybrid.programs import program
from jaxcam.parameters import AnyArray

from .._parameter import with_leaf
from .._point import set_parameters, with_field
from ..problem import AbstractProblem, Monitor, StabilityKind
from ._bialternate import (
    additive,
    determinant_on_plane,
    multiplicative,
    trace_on_plane,
)
from ._extended import AbstractExtended
from ._jacobian import jacobian_of
from ._multilinear import second, third
from ._test_functions import FLIP, FOLD, has_own_dynamics, HOPF, NEIMARK_SACKER


# pairs of noncritical eigenvalues are monitored up to this dimension
_LARGEST_FOR_PAIRS = 8


def singular_matrix(problem, kind: str, u, parameters):
    """Return the matrix that is singular at this kind of point."""
    jacobian = jacobian_of(problem, u, parameters)
    if kind == FOLD:
        return jacobian
    a = problem.linearisation(u, parameters, jacobian)
    if kind == FLIP:
        return a + jnp.eye(a.shape[0], dtype=a.dtype)
    if kind == HOPF:
        return additive(a)
    assert kind == NEIMARK_SACKER, kind
    product = multiplicative(a)
    return product - jnp.eye(product.shape[0], dtype=a.dtype)


@program
def _singular_matrix(problem, kind: str, leaf: int, z):
    parameters = with_leaf(problem.parameters, leaf, z[-1])
    return singular_matrix(problem, kind, z[:-1], parameters)


def matrix_at(problem, kind: str, leaf: int, z) -> np.ndarray:
    """Return `singular_matrix` at z = (u, parameter), computed by a compiled
    program.
    """
    return np.asarray(_singular_matrix(problem, kind, leaf, np.asarray(z)))


class SingularPoints(AbstractExtended):
    """Points (u, parameter) on a branch at which a matrix is singular.

    The equations are G = 0 and g = 0, where [[M, b], [c', 0]] (v, g) = (0, 1)
    (Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, 2000). M is
    dG/du for a fold, A + I for a flip, and a bialternate product for a pair of
    eigenvalues. There is one more equation and one more unknown than in the problem,
    and the system is regular at simple special points.
    """

    base: AbstractProblem
    kind: str = eqx.field(static=True)
    leaf: int = eqx.field(static=True)
    width: AnyArray
    bounds: AnyArray
    b: AnyArray
    c: AnyArray
    stability: ClassVar[StabilityKind] = "none"

    def _matrix(self, u, parameters):
        inner, parameters = self.inside(u, parameters)
        return singular_matrix(self.base, self.kind, inner, parameters)

    def _bordered(self, m, transposed: bool):
        b, c = (self.c, self.b) if transposed else (self.b, self.c)
        m = m.T if transposed else m
        top = jnp.concatenate([m, b[:, None]], axis=1)
        bottom = jnp.concatenate([c, jnp.zeros(1, c.dtype)])
        right = jnp.zeros_like(bottom).at[-1].set(1.0)
        return jnp.linalg.solve(jnp.concatenate([top, bottom[None, :]]), right)

    def residual(self, u: Float[Array, " n"], parameters: PyTree):
        inner, inside = self.inside(u, parameters)
        g = self._bordered(self._matrix(u, parameters), False)[-1]
        return jnp.concatenate([self.base.residual(inner, inside), g[None]])

    def null_vectors(self, u, parameters):
        """Return the unit right and left null vectors of the singular matrix."""
        m = self._matrix(u, parameters)
        right = self._bordered(m, False)[:-1]
        left = self._bordered(m, True)[:-1]
        return right / jnp.linalg.norm(right), left / jnp.linalg.norm(left)

    def refreshed(self, u: np.ndarray, parameters: PyTree) -> "SingularPoints":
        base = set_parameters(self.base, parameters)
        m = matrix_at(base, self.kind, self.leaf, u)
        left, _, right = np.linalg.svd(m)
        # signs are kept continuous, so that test functions of null vectors are
        # continuous
        b = left[:, -1] * (-1.0 if left[:, -1] @ np.asarray(self.b) < 0 else 1.0)
        c = right[-1] * (-1.0 if right[-1] @ np.asarray(self.c) < 0 else 1.0)
        return with_field(with_field(self, "b", b), "c", c)

    @property
    def signature(self) -> str:
        return f"{self.kind} of {self.base.signature}"

    def monitor_of_base(self, name: str) -> str:
        return f"base {name}"

    def _dimension(self) -> int:
        k = self.b.shape[0]
        if self.kind in (FOLD, FLIP):
            return k
        return round((1 + (1 + 8 * k) ** 0.5) / 2)

    def monitors(self) -> dict[str, Monitor]:
        names = {}
        n, small = self._dimension(), self._dimension() <= _LARGEST_FOR_PAIRS
        stability = self.base.stability
        if self.kind == FOLD:
            names["cusp"] = "cusp"
            if stability == "equilibrium":
                names["double"] = "Bogdanov-Takens"
                if small and n >= 3:
                    names["pair"] = "zero-Hopf"
            if stability == "map":
                names["double"] = "1:1 resonance"
                names["other"] = "fold-flip"
                if small and n >= 3:
                    names["pair"] = "fold-Neimark-Sacker"
        elif self.kind == FLIP:
            if self.base.normal_forms and not has_own_dynamics(self.base):
                names["degenerate"] = "generalized flip"
            names["double"] = "1:2 resonance"
            names["other"] = "fold-flip"
            if small and n >= 3:
                names["pair"] = "flip-Neimark-Sacker"
        elif self.kind == HOPF:
            names["double"] = "Bogdanov-Takens"
            if n >= 3:
                names["other"] = "zero-Hopf"
        else:
            names["double"] = "1:1 resonance"
            names["opposite"] = "1:2 resonance"
            names["third"] = "1:3 resonance"
            names["fourth"] = "1:4 resonance"
        # beyond these points, the pair is real, and the points are neutral saddles
        last = ("double", "opposite") if self.kind in (HOPF, NEIMARK_SACKER) else ()
        found = {k: Monitor(v, ends=k in last) for k, v in names.items()}
        for name, monitor in self.base.monitors().items():
            found[self.monitor_of_base(name)] = Monitor(
                f"{self.kind}-{monitor.kind}", ends=monitor.ends
            )
        return found

    def seen(self, u: Float[Array, " n"], parameters: PyTree):
        wanted = self.monitors()
        inner, inside = self.inside(u, parameters)
        base = self.base
        a = base.linearisation(inner, inside, jacobian_of(base, inner, inside))
        one = jnp.eye(a.shape[0], dtype=a.dtype)
        right, left = self.null_vectors(u, parameters)
        values = {}
        if self.kind == FOLD:
            bent = second(lambda u: base.residual(u, inside), inner, right, right)
            values["cusp"] = left @ bent
            values["double"] = left @ right
            values["other"] = jnp.linalg.det(a + one)
        elif self.kind == FLIP:
            values["double"] = left @ right
            values["other"] = jnp.linalg.det(a - one)
            if "degenerate" in wanted:
                motion = base.local_dynamics(inner, inside).motion
                values["degenerate"] = flip_coefficient(motion, inner, a, right, left)
        elif self.kind == HOPF:
            values["double"] = determinant_on_plane(a, right)
            values["other"] = jnp.linalg.det(a) / values["double"]
        else:
            trace = trace_on_plane(a, right)
            values["double"], values["opposite"] = 2 - trace, 2 + trace
            values["third"], values["fourth"] = trace + 1, trace
        if "pair" in wanted:
            if base.stability == "equilibrium":
                values["pair"] = jnp.linalg.det(additive(a))
            else:
                product = multiplicative(a)
                values["pair"] = jnp.linalg.det(
                    product - jnp.eye(product.shape[0], dtype=a.dtype)
                )
        others, observed = base.seen(inner, inside)
        for name, value in others.items():
            values[self.monitor_of_base(name)] = value
        return {name: values[name] for name in wanted}, observed


def flip_coefficient(motion, u, a, right, left):
    """Return the coefficient c of the flip normal form x -> -x + c x^3, times left .
    right and the determinant of A - I.

    See Kuznetsov, section 5.4. The factors keep the result finite at 1:2 resonances and
    fold-flips, where c has poles.
    """
    one = jnp.eye(a.shape[0], dtype=a.dtype)
    bqq = second(motion, u, right, right)
    inner = jnp.linalg.solve(a - one, bqq)
    c = third(motion, u, right, right, right)
    c = left @ (c - 3 * second(motion, u, right, inner)) / 6
    return c * jnp.linalg.det(a - one)
