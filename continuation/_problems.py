"""Problems defined by plain functions."""

from collections.abc import Callable
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jaxcam.hybrid.programs import program

from ._limit_cycle import cycle_at_hopf
from .problem import AbstractProblem, StabilityKind, Start
from .representation import AbstractRepresentation
from .special import FLIP, flip_direction, HOPF


class Equations(AbstractProblem):
    """Equations of the form function(u, parameters) = 0; stability is not computed.

    An example is a discretised boundary value problem.

    Examples:
        >>> import continuation
        >>> f = lambda u, p: u**2 + p["a"] ** 2 - 1
        >>> circle = continuation.Equations(f, {"a": 0.0})
        >>> float(circle.residual(jnp.ones(1), {"a": 0.0})[0])
        0.0
    """

    function: Callable[[Array, Any], Array]
    """Function of a state `(n,)` and the parameters that returns residuals `(n,)`."""
    parameters: PyTree
    """The parameters: any pytree with scalar floats among its leaves."""
    stability: ClassVar[StabilityKind] = "none"
    """Stability is not computed."""

    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        return self.function(u, parameters)


class Equilibrium(AbstractProblem):
    """Equilibria of u' = vector_field(u, parameters).

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> float(problem.residual(jnp.ones(1), {"a": 1.0})[0])
        0.0
    """

    vector_field: Callable[[Array, Any], Array]
    """Function of a state `(n,)` and the parameters that returns its rate of change
    `(n,)`.
    """
    parameters: PyTree
    """The parameters: any pytree with scalar floats among its leaves."""
    stability: ClassVar[StabilityKind] = "equilibrium"
    """Eigenvalues on the imaginary axis mark bifurcations."""

    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        return self.vector_field(u, parameters)

    def transition(self, point: Any, at: Any) -> Start | None:
        if point.kind != HOPF:
            return None
        return cycle_at_hopf(
            self.vector_field, self.parameters, point, at.linearisation
        )


class FixedPoint(AbstractProblem):
    """Points of period `period` of the map u -> map(u, parameters).

    Examples:
        >>> import continuation
        >>> f = lambda u, p: p["a"] * u * (1 - u)
        >>> logistic = continuation.FixedPoint(f, {"a": 2.0})
        >>> float(logistic.residual(jnp.array([0.5]), {"a": 2.0})[0])
        0.0
    """

    map: Callable[[Array, Any], Array]
    """Function of a state `(n,)` and the parameters that returns its image `(n,)`."""
    parameters: PyTree
    """The parameters: any pytree with scalar floats among its leaves."""
    period: Int[Array, ""]
    """Number of iterations of the map, >= 1. All periods share one compiled program."""
    stability: ClassVar[StabilityKind] = "map"
    """Multipliers on the unit circle mark bifurcations."""

    def __init__(
        self, map: Callable[[Any, Any], Array], parameters: PyTree, period: int = 1
    ):
        if isinstance(period, int) and period < 1:
            raise ValueError(f"period is {period}; give a whole number >= 1")
        self.map = map
        self.parameters = parameters
        self.period = jnp.asarray(period, jnp.int32)

    def residual(self, u: Float[Array, " n"], parameters: PyTree) -> Float[Array, " n"]:
        moved = jax.lax.fori_loop(
            0, self.period, lambda _, u: self.map(u, parameters), u
        )
        return moved - u

    def transition(self, point: Any, at: Any) -> Start | None:
        if point.kind != FLIP:
            return None
        direction = flip_direction(at.linearisation)
        twice = eqx.tree_at(lambda p: p.period, self, 2 * self.period)
        return Start(twice, point.state, point.parameter, np.append(direction, 0.0))

    @property
    def representation(self) -> "PeriodicPoints":
        return PeriodicPoints(self.signature, self)

    @property
    def signature(self) -> str:
        return f"period {int(self.period)}"

    def with_signature(self, signature: str) -> AbstractProblem:
        word, _, number = signature.partition(" ")
        if word != "period" or not number.isdecimal():
            return super().with_signature(signature)
        return FixedPoint(self.map, self.parameters, int(number))


class PeriodicPoints(AbstractRepresentation):
    """The representations of a periodic orbit of a map: any of its points."""

    family: str = eqx.field(static=True)
    problem: FixedPoint

    def copies(self, u, tangent):
        found = [(self.family, u, tangent)]
        for _ in range(int(self.problem.period) - 1):
            u, tangent = _mapped(self.problem, u, tangent)
            found.append((self.family, np.asarray(u), np.asarray(tangent)))
        return found

    def brought_near(self, states, u):
        del u
        return states

    def half_away(self, u, parameters):
        problem = self.problem
        if int(problem.period) % 2:
            return None
        half = eqx.tree_at(lambda p: p.period, problem, problem.period // 2)
        moved, scale = _moved(half, jnp.asarray(u), parameters)
        return float(np.linalg.norm(np.asarray(moved) / np.asarray(scale)))


@program
def _mapped(problem: FixedPoint, u, tangent):
    """Return the next point of an orbit, and the image of the tangent at that point."""
    return jax.jvp(lambda u: problem.map(u, problem.parameters), (u,), (tangent,))


@program
def _moved(problem: FixedPoint, u, parameters):
    return problem.residual(u, parameters), problem.scale(u, parameters)
