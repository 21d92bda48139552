"""Compute points at which a monitor is zero as solutions of an extended problem."""

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxcam.parameters import AnyArray

from .._context import Context
from .._padding import Padded
from .._parameter import with_leaf
from ..problem import AbstractProblem, Monitor, StabilityKind
from ._extended import AbstractExtended


class MonitorPoints(AbstractExtended):
    """Points (u, parameter) on a branch at which a monitor of the problem is zero."""

    base: AbstractProblem
    name: str = eqx.field(static=True)
    leaf: int = eqx.field(static=True)
    width: AnyArray
    bounds: AnyArray
    stability: ClassVar[StabilityKind] = "none"

    def residual(self, u: Float[Array, " n"], parameters: PyTree):
        inner, inside = self.inside(u, parameters)
        number = list(self.base.monitors()).index(self.name)
        value = self.base.watched(number, inner, inside)
        return jnp.append(self.base.residual(inner, inside), value)

    def seen(self, u: Float[Array, " n"], parameters: PyTree):
        values, observed = self.base.seen(*self.inside(u, parameters))
        return {name: values[name] for name in self.monitors()}, observed

    def monitors(self) -> dict[str, Monitor]:
        own = self.base.monitors()[self.name]
        silent = (self.name, *self.base.monitors()[self.name].vanishing)
        return {
            name: Monitor(f"{own.kind}-{other.kind}", ends=other.ends)
            for name, other in self.base.monitors().items()
            if name not in silent
        }

    @property
    def signature(self) -> str:
        kind = self.base.monitors()[self.name].kind
        return f"{kind} of {self.base.signature}"


class MonitorLevel(AbstractProblem):
    """The point (u, parameter) on a branch at which a monitor has a given value.

    The index of the monitor is an array, so that one program can find the zeros of all
    monitors, unless the derivatives of a monitor are costly.
    """

    base: AbstractProblem
    leaf: int = eqx.field(static=True)
    width: AnyArray
    number: int | AnyArray
    level: AnyArray
    stability: ClassVar[StabilityKind] = "none"

    @property
    def parameters(self) -> PyTree:
        return self.base.parameters

    def padded(self) -> Padded | None:
        base = self.base.padded()
        if base is None:
            return None
        wide = _level(base.problem, self.leaf, self.width, self.number, self.level)
        kept = np.append(base.kept, base.size)
        return Padded(wide, kept, base.size + 1)

    def residual(self, u: Float[Array, " n"], parameters: PyTree):
        inner, inside = u[:-1], with_leaf(parameters, self.leaf, u[-1])
        number = (
            self.number if isinstance(self.number, int) else jnp.asarray(self.number)
        )
        value = self.base.watched(number, inner, inside)
        return jnp.append(self.base.residual(inner, inside), value - self.level)

    def scale(self, u: Float[Array, " n"], parameters: PyTree):
        inside = with_leaf(parameters, self.leaf, u[-1])
        sizes = self.base.scale(u[:-1], inside)
        return jnp.concatenate([sizes, jnp.reshape(self.width, (1,))])


# `parameters` is a property, but type checkers take it for a constructor argument
_level: Any = MonitorLevel


def monitor_level(
    problem: AbstractProblem, name: str, context: Context, level: float = 0.0
) -> MonitorLevel:
    """Return the problem of finding the point at which a monitor has this value."""
    monitors = problem.monitors()
    number: Any = list(monitors).index(name)
    if not any(monitor.bracket for monitor in monitors.values()):
        number = np.asarray(number)
    return _level(
        problem, context.leaf, np.asarray(context.width), number, np.asarray(level)
    )
