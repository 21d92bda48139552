"""Branch points as regular solutions of a larger problem."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ._parameter import with_leaf
from ._problem import AbstractProblem, Stability


class BranchPoints(AbstractProblem):
    """Simple branch points: unknowns (u, parameter, slack, left null vector).

    G + slack psi = 0, psi' G_u = 0, psi' G_p = 0, psi' psi = 1: 2 n + 2 equations,
    whose solution is regular where two branches cross at an angle (Kuznetsov, section
    10.2).
    """

    base: AbstractProblem
    leaf: int = eqx.field(static=True)
    width: Array
    stability: ClassVar[Stability] = "none"

    @property
    def parameters(self) -> PyTree:
        return self.base.parameters

    def residual(self, u: Float[Array, " n"], parameters: PyTree):
        n = (u.shape[0] - 2) // 2
        inner, p, slack, psi = u[:n], u[n], u[n + 1], u[n + 2 :]

        def g(inner, p):
            return self.base.residual(inner, with_leaf(parameters, self.leaf, p))

        value = g(inner, p)
        j_u = self.base.jacobian(inner, with_leaf(parameters, self.leaf, p))
        _, j_p = jax.jvp(lambda p: g(inner, p), (p,), (jnp.ones_like(p),))
        rest = jnp.stack([psi @ j_p, psi @ psi - 1.0])
        return jnp.concatenate([value + slack * psi, psi @ j_u, rest])

    def scale(self, u: Float[Array, " n"], parameters: PyTree):
        n = (u.shape[0] - 2) // 2
        sizes = self.base.scale(u[:n], with_leaf(parameters, self.leaf, u[n]))
        ones = jnp.ones(n + 1, u.dtype)
        return jnp.concatenate([sizes, jnp.reshape(self.width, (1,)), ones])
