"""A system with an element that has an internal state."""

import equinox as eqx
import jax
import jax.numpy as jnp

from ...hybrid import HybridSystem, Wrapping
from ._hidden_elements import HiddenElement


class WithHidden(Wrapping):
    """A system with an element that is driven by a coordinate and exerts a force on it.

    The state is that of the base followed by that of the element; the state of the
    element does not change at impacts.
    """

    base: HybridSystem
    """The system, a `WithTerms` or any other."""
    element: HiddenElement
    """A `Resonator`, `Relaxation` or `Hysteresis`."""
    coordinate: tuple[int, int] = eqx.field(
        default=(0, 1), static=True, metadata={"spare": True}
    )
    """Components of the base state that are the coordinate (which drives the element
    and on which its force acts) and its velocity.
    """

    @property
    def inner(self) -> HybridSystem:
        return self.base

    @property
    def _size(self) -> int:
        """Number of state components of the element."""
        return len(self.element.names)

    @property
    def state_names(self) -> tuple[str, ...]:  # pyright: ignore
        names = self.base.state_names
        return (*names, *self.element.names) if names else ()

    @property
    def state_units(self) -> tuple[str, ...]:  # pyright: ignore
        units = self.base.state_units
        if not units:
            return ()
        return (*units, *self.element.units(units[self.coordinate[0]]))

    @property
    def speed(self):
        """Speed of the drive (rad/s), if the base has one."""
        return self.base.speed  # pyright: ignore

    def check(self) -> None:
        self.base.check()
        self.element.check()

    def vector_field(self, t, state) -> jax.Array:
        return self._driven(state, self.base.vector_field(t, self._own(state)))

    def _own(self, state) -> jax.Array:
        """Return the state of the base."""
        return state[: -self._size]

    def _driven(self, state, rate) -> jax.Array:
        """Return the rate of change of the state, given that of the base."""
        own, hidden = state[: -self._size], state[-self._size :]
        place, pushed = self.coordinate
        position, velocity = own[place], own[pushed]
        rate = rate.at[pushed].add(self.element.force(position, velocity, hidden))
        return jnp.concatenate([rate, self.element.rate(position, velocity, hidden)])

    def gap(self, t, state) -> jax.Array:
        return self.base.gap(t, self._own(state))

    def impact(self, t, state) -> jax.Array:
        return self._kept(state, self.base.impact(t, self._own(state)))

    def _kept(self, state, after) -> jax.Array:
        """Return base states after an event, followed by the state of the element."""
        hidden = state[-self._size :]
        kept = jnp.broadcast_to(hidden, (*after.shape[:-1], self._size))
        return jnp.concatenate([after, kept], axis=-1)
