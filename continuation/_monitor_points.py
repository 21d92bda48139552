"""Points at which a monitor is zero, as solutions of a larger problem."""

from typing import ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from ._parameter import with_leaf
from ._point import Point
from ._problem import AbstractProblem, Monitor, Stability


class MonitorPoints(AbstractProblem):
    """Points (u, parameter) on a branch where a monitor of the problem is zero."""

    base: AbstractProblem
    name: str = eqx.field(static=True)
    leaf: int = eqx.field(static=True)
    width: Array
    bounds: Array
    #: the value that the monitor is to have
    level: Array = eqx.field(default_factory=lambda: jnp.zeros(()))
    stability: ClassVar[Stability] = "none"

    @property
    def parameters(self) -> PyTree:
        return self.base.parameters

    @property
    def detects(self) -> bool:
        return False

    def _split(self, u, parameters):
        return u[:-1], with_leaf(parameters, self.leaf, u[-1])

    def residual(self, u: Float[Array, " n"], parameters: PyTree):
        inner, inside = self._split(u, parameters)
        value = self.base.watched(self.name, inner, inside) - self.level
        return jnp.concatenate(
            [self.base.residual(inner, inside), jnp.reshape(value, (1,))]
        )

    def linearisation(self, u: Float[Array, " n"], parameters: PyTree, jacobian):
        del jacobian
        inner, inside = self._split(u, parameters)
        return self.base.linearisation(inner, inside, self.base.jacobian(inner, inside))

    @property
    def normal_forms(self) -> bool:
        return False

    def observe(self, u: Float[Array, " n"], parameters: PyTree) -> dict[str, Array]:
        return self.base.observe(*self._split(u, parameters))

    def monitor(self, u: Float[Array, " n"], parameters: PyTree) -> dict[str, Array]:
        return self.seen(u, parameters)[0]

    def seen(self, u: Float[Array, " n"], parameters: PyTree):
        values, observed = self.base.seen(*self._split(u, parameters))
        return {name: values[name] for name in self.monitors()}, observed

    def monitors(self) -> dict[str, Monitor]:
        own = self.base.monitors()[self.name]
        silent = (self.name, *self.base.vanishing_with(self.name))
        return {
            name: Monitor(f"{own.kind}-{other.kind}", ends=other.ends)
            for name, other in self.base.monitors().items()
            if name not in silent
        }

    def scale(self, u: Float[Array, " n"], parameters: PyTree):
        sizes = self.base.scale(*self._split(u, parameters))
        return jnp.concatenate([sizes, jnp.reshape(self.width, (1,))])

    def free(self, u: np.ndarray) -> tuple[float, ...]:
        return (*self.base.free(u[:-1]), float(u[-1]))

    def limits(self) -> dict[int, tuple[float, float]]:
        return {
            **self.base.limits(),
            -1: (float(self.bounds[0]), float(self.bounds[1])),
        }

    def check(self, point: Point) -> str | None:
        return self.base.check(point.inner(self.base, self.leaf))

    @property
    def signature(self) -> str:
        kind = self.base.monitors()[self.name].kind
        return f"{kind} of {self.base.signature}"
