"""Add a Poincaré section to a system, as one more switching surface."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Int

from ._switched import SwitchedSystem
from ._system import HybridSystem
from ._wrapping import Wrapping
from .surface import has_friction, surfaces


class WithSection(Wrapping, SwitchedSystem):
    """A system with a Poincaré section as its last switching surface.

    The section changes neither the vector field nor the state. Steps end at it, and the
    event loop counts its crossings in the given direction, except those caused by
    impacts.
    """

    system: HybridSystem
    function: Callable = eqx.field(static=True)
    """Function of time and state that is zero on the section."""
    direction: int = eqx.field(static=True)
    """+1 to count rising crossings, -1 for falling ones, 0 for both."""
    number: int = eqx.field(static=True)
    """Number of switching surfaces of the system."""

    @property
    def inner(self) -> HybridSystem:
        """Return the system."""
        return self.system

    def switching(self, t, state):
        """Return the switching functions of the system, then that of the section."""
        own = self._own(t, state, "switching", jnp.zeros(0))
        last = jnp.asarray(self.function(t, state), dtype=jnp.float64)
        return jnp.append(jnp.atleast_1d(own), last)

    def distances(self, t, state, sides):
        """Return the distances from the surfaces of the system and from the section."""
        own = jnp.zeros(0)
        if isinstance(self.system, SwitchedSystem):
            own = self.system.distances(t, state, sides[:-1])
        return jnp.append(own, sides[-1] * self.function(t, state))

    def branch(self, t, state, sides):
        """Return the rates of the system."""
        if isinstance(self.system, SwitchedSystem):
            return self.system.branch(t, state, sides[:-1])
        return self.system.vector_field(t, state)

    def sides(self, t, state):
        """Return the sides of the system, then that of the section."""
        own = self._own(t, state, "sides", jnp.zeros(0))
        return jnp.append(own, jnp.where(self.function(t, state) >= 0, 1.0, -1.0))

    def reset(self, t, state, sides):
        """Return the states after the system's resets, then the unchanged state."""
        if not isinstance(self.system, SwitchedSystem):
            return state[None]
        own = jnp.atleast_2d(self.system.reset(t, state, sides[:-1]))
        return jnp.concatenate([own, state[None]])

    def gap(self, t, state):
        """Return the gaps of the system."""
        return self.system.gap(t, state)

    def impact(self, t, state):
        """Return the states after the impacts of the system."""
        return self.system.impact(t, state)

    def sides_changed(self, number: int) -> tuple[tuple[int, ...], ...]:
        """Return, for each surface, the surfaces whose sides change at its crossing."""
        if not isinstance(self.system, SwitchedSystem):
            return super().sides_changed(number)
        return (*self.system.sides_changed(number - 1), (number - 1,))

    def remembered_sides(self, number: int) -> Int[np.ndarray, "discrete k"]:
        """Return the sides that depend on the past, in each discrete state."""
        own = np.zeros((1, number - 1), dtype=int)
        if isinstance(self.system, SwitchedSystem):
            own = self.system.remembered_sides(number - 1)
        return np.pad(own, ((0, 0), (0, 1)))

    def met_surfaces(self, number: int) -> Bool[np.ndarray, "discrete k"]:
        """Return which surfaces a motion can cross in each discrete state."""
        own = np.ones((1, number - 1), dtype=bool)
        if isinstance(self.system, SwitchedSystem):
            own = self.system.met_surfaces(number - 1)
        return np.pad(own, ((0, 0), (0, 1)), constant_values=True)

    @property
    def one_way(self) -> int:
        """Return the number of transitions between modes of the system."""
        return self.system.one_way if isinstance(self.system, SwitchedSystem) else 0

    @property
    def remembers(self) -> bool:
        """Return whether the sides of the system depend on the past."""
        return isinstance(self.system, SwitchedSystem) and self.system.remembers

    @property
    def hysteresis(self) -> Any:
        """Return the hysteresis of each surface."""
        return self._each("hysteresis", 0.0)

    @property
    def holding(self) -> Any:
        """Return the ratio of static to kinetic friction at each surface."""
        return self._each("holding", 1.0)

    @property
    def has_contact_friction(self) -> bool:
        """Return whether the contacts of the system have friction."""
        return has_friction(self.system)

    def contact_friction(self, t, state, sides):
        """Return the friction of each contact of the system."""
        if isinstance(self.system, SwitchedSystem):
            return self.system.contact_friction(t, state, sides[:-1])
        return super().contact_friction(t, state, sides)

    @property
    def restitution_kind(self):
        """Return the meaning of the coefficient of restitution of the system."""
        if isinstance(self.system, SwitchedSystem):
            return self.system.restitution_kind
        return "kinematic"

    def _own(self, t, state, name: str, otherwise):
        if isinstance(self.system, SwitchedSystem):
            return getattr(self.system, name)(t, state)
        return otherwise

    def _each(self, name: str, of_section: float):
        """Return the named value for each surface of the system, then `of_section`."""
        if not self.number:
            return of_section
        own = jnp.asarray(getattr(self.system, name), dtype=jnp.float64)
        return jnp.append(jnp.broadcast_to(own, (self.number,)), of_section)


def with_section(
    system: HybridSystem, function: Callable, direction: int, n: int
) -> WithSection:
    """Return a system of `n` state components with a Poincaré section.

    **Raises:** `ValueError` if the function does not return a scalar.
    """
    time, state = jnp.zeros(()), jnp.zeros(n)
    value = jax.eval_shape(lambda t, x: jnp.asarray(function(t, x)), time, state)
    if value.shape != ():
        raise ValueError(
            f"the function of the section returns shape {value.shape}; return one "
            "number"
        )
    shapes = jax.eval_shape(lambda t, x: surfaces(system, t, x), time, state)
    return WithSection(system, function, direction, shapes.shape[0])
