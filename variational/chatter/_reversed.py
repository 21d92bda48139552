"""Reverse the time of a system."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from jaxcam import HybridSystem
from jaxcam.hybrid import Wrapping
from jaxcam.hybrid.surface import normal_directions, normal_velocity

from ._scalar import one_constraint


_NEWTON = 8


class Reversed(Wrapping):
    """A system whose motion at time t is that of `forward` at time -t.

    Its impacts reverse those of `forward`: the speed is divided by the coefficient of
    restitution, which must be positive. There must be only one constraint.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import Reversed
        >>> Reversed(BouncingBall()).impact(0.0, jnp.array([0.0, -0.8])).tolist()
        [0.0, 1.0]
    """

    active: ClassVar[bool] = True
    """Impacts add energy in reversed time."""

    forward: HybridSystem
    """The system in forward time."""

    @property
    def inner(self) -> HybridSystem:
        """Return the system in forward time."""
        return self.forward

    @property
    def breakpoints(self) -> jax.Array | None:
        """Return minus the breakpoints of `forward` (s), or `None`."""
        times = self.forward.breakpoints
        return None if times is None else -jnp.asarray(times, dtype=jnp.float64)

    def vector_field(self, t, state) -> jax.Array:
        """Return minus the field of `forward`.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            Rate of change of the state, shape `(n,)`.
        """
        return -self.forward.vector_field(-jnp.asarray(t), state)

    def gap(self, t, state) -> jax.Array:
        """Return the gap of `forward`.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            A scalar.
        """
        return self.forward.gap(-jnp.asarray(t), state)

    def impact(self, t, state) -> jax.Array:
        """Return the state from which an impact of `forward` leads to `state`.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.

        Returns:
            State, shape `(n,)`.
        """
        time = -jnp.asarray(t)
        direction = normal_directions(self.forward, time, state)[0]

        def rebound(v):
            before = rest + v * direction
            after = one_constraint(self.forward.impact(time, before), 1)
            return normal_velocity(self.forward, time, after)[0]

        wanted = normal_velocity(self.forward, time, state)[0]
        rest = state - wanted * direction

        def newton(_, v):
            value, slope = jax.jvp(rebound, (v,), (jnp.ones_like(v),))
            return v - (value - wanted) / slope

        before = jax.lax.fori_loop(0, _NEWTON, newton, -wanted)
        return rest + before * direction
