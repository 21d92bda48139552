"""Extend a problem by one unknown, the parameter."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from .._parameter import with_leaf
from .._point import Point, replace
from ..problem import AbstractProblem, StabilityKind
from ._jacobian import jacobian_of


class AbstractExtended(AbstractProblem):
    """The equations of a problem and one more condition, with unknowns (u,
    parameter).
    """

    base: eqx.AbstractVar[AbstractProblem]
    leaf: eqx.AbstractVar[int]
    bounds: eqx.AbstractVar[Array]
    """Bounds `(2,)` of the parameter that is an unknown; the branch ends exactly on
    them.
    """
    width: eqx.AbstractVar[Array]
    """Width of these bounds."""
    stability: ClassVar[StabilityKind] = "none"
    normal_forms: ClassVar[bool] = False
    detects: ClassVar[bool] = False

    @property
    def parameters(self) -> PyTree:
        return self.base.parameters

    def inside(self, u, parameters):
        """Return the unknowns and parameters of the inner problem."""
        return u[:-1], with_leaf(parameters, self.leaf, u[-1])

    def linearisation(self, u: Float[Array, " n"], parameters: PyTree, jacobian):
        inner, inside = self.inside(u, parameters)
        jacobian = jacobian_of(self.base, inner, inside)
        return self.base.linearisation(inner, inside, jacobian)

    def scale(self, u: Float[Array, " n"], parameters: PyTree):
        sizes = self.base.scale(*self.inside(u, parameters))
        return jnp.concatenate([sizes, jnp.reshape(self.width, (1,))])

    def check(self, point: Point) -> str | None:
        inner = point.inner(self.base, self.leaf)
        tests = {
            name: point.tests[here]
            for name in self.base.monitors()
            if (here := self.monitor_of_base(name)) in point.tests
        }
        return self.base.check(replace(inner, tests=tests))

    def monitor_of_base(self, name: str) -> str:
        """Return the name that a monitor of the inner problem has in this problem."""
        return name


def varied(problem: AbstractProblem, z) -> tuple[float, ...]:
    """Return the values of the varying parameters at z = (u, parameter); two on a
    curve.
    """
    first = (float(z[-2]),) if isinstance(problem, AbstractExtended) else ()
    return *first, float(z[-1])
