"""Problems stated by plain functions."""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from ._limit_cycle import cycle_at_hopf
from ._problem import AbstractProblem, Stability, Start


class Equations(AbstractProblem):
    """function(u, parameters) = 0, with no stability: discretised boundary value
    problems, for example.

    **Arguments:**

    - `function`: maps a state (n,) and the parameters to (n,).
    - `parameters`: any pytree with scalar floats among its leaves.
    """

    function: Callable[[Array, Any], Array]
    parameters: PyTree
    stability: ClassVar[Stability] = "none"

    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        return self.function(u, parameters)


class Equilibrium(AbstractProblem):
    """Equilibria of u' = vector_field(u, parameters)."""

    vector_field: Callable[[Array, Any], Array]
    parameters: PyTree
    stability: ClassVar[Stability] = "equilibrium"

    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        return self.vector_field(u, parameters)

    def cycle(self, point: Any, matrix: np.ndarray) -> Start | None:
        return cycle_at_hopf(self.vector_field, self.parameters, point, matrix)


class FixedPoint(AbstractProblem):
    """Points of period `period` of u -> map(u, parameters).

    **Arguments:**

    - `map`: maps a state (n,) and the parameters to (n,).
    - `parameters`: any pytree with scalar floats among its leaves.
    - `period`: number of applications of the map, >= 1. All periods share one compiled
      program.
    """

    map: Callable[[Array, Any], Array]
    parameters: PyTree
    period: Int[Array, ""]
    stability: ClassVar[Stability] = "map"

    def __init__(
        self, map: Callable[[Any, Any], Array], parameters: PyTree, period: int = 1
    ):
        if isinstance(period, int) and period < 1:
            raise ValueError(f"period is {period}; give a whole number >= 1")
        self.map = map
        self.parameters = parameters
        self.period = jnp.asarray(period, jnp.int32)

    def motion(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        return jax.lax.fori_loop(
            0, self.period, lambda _, u: self.map(u, parameters), u
        )

    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        return self.motion(u, parameters) - u

    def doubled(self, point: Any, direction: np.ndarray) -> Start:
        twice = eqx.tree_at(lambda p: p.period, self, 2 * self.period)
        return Start(twice, point.state, point.parameter, np.append(direction, 0.0))

    def copies(self, u, tangent):
        found = [(self.family, u, tangent)]
        for _ in range(int(self.period) - 1):
            u, tangent = _mapped(self, u, tangent)
            found.append((self.family, np.asarray(u), np.asarray(tangent)))
        return found

    def half_away(self, u, parameters):
        if int(self.period) % 2:
            return None
        half = eqx.tree_at(lambda p: p.period, self, self.period // 2)
        moved, scale = _moved(half, jnp.asarray(u), parameters)
        return float(np.linalg.norm(np.asarray(moved) / np.asarray(scale)))

    @property
    def signature(self) -> str:
        return f"period {int(self.period)}"

    def with_signature(self, signature: str) -> "FixedPoint":
        word, _, number = signature.partition(" ")
        if word != "period" or not number.isdecimal():
            raise ValueError(
                f"the saved branch has signature {signature!r}, which is no period of "
                "a map; take it up with the problem it was made with"
            )
        return FixedPoint(self.map, self.parameters, int(number))


@eqx.filter_jit
def _mapped(problem: FixedPoint, u, tangent):
    """The next point of an orbit, and a deviation there."""
    return jax.jvp(lambda u: problem.map(u, problem.parameters), (u,), (tangent,))


@eqx.filter_jit
def _moved(problem: FixedPoint, u, parameters):
    return problem.residual(u, parameters), problem.scale(u, parameters)
