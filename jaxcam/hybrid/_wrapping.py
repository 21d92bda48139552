"""A system built around another one, whose declarations it keeps."""

import abc
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Int

from ._switched import SwitchedSystem
from ._system import HybridSystem


class Wrapping(HybridSystem):
    """A system that contains another one, `inner`, and forwards its declarations:
    period, breakpoints, names, `active`, preparation and check.

    Subclass it to change some of the functions of any system: store the system in a
    field and return it from the property `inner`. Override a declaration only if it
    differs from that of the inner system. Around a `SwitchedSystem`, use
    `SwitchedWrapping`; otherwise, there are no switching surfaces.

    Examples:
        >>> from jaxcam.hybrid import Wrapping
        >>> from jaxcam.models import ImpactOscillator
        >>> class Braked(Wrapping):
        ...     base: jaxcam.HybridSystem
        ...     @property
        ...     def inner(self):
        ...         return self.base
        ...     def vector_field(self, t, state):
        ...         braking = jnp.stack([0.0, -0.1 * state[1]])
        ...         return self.base.vector_field(t, state) + braking
        ...     def gap(self, t, state):
        ...         return self.base.gap(t, state)
        ...     def impact(self, t, state):
        ...         return self.base.impact(t, state)
        >>> base = ImpactOscillator()
        >>> bool(Braked(base).period == base.period)
        True
    """

    @property
    @abc.abstractmethod
    def inner(self) -> HybridSystem:
        """Return the system inside."""

    @property
    def state_names(self) -> tuple[str, ...]:  # pyright: ignore
        """Return the names of the state components."""
        return self.inner.state_names

    @property
    def state_units(self) -> tuple[str, ...]:  # pyright: ignore
        """Return the units of the state components."""
        return self.inner.state_units

    @property
    def constraint_names(self) -> tuple[str, ...]:  # pyright: ignore
        """Return the names of the constraints."""
        return self.inner.constraint_names

    @property
    def active(self) -> bool:  # pyright: ignore
        """Return whether impacts may add energy."""
        return self.inner.active

    @property
    def steep(self) -> bool:  # pyright: ignore
        """Return whether a force changes steeply with the state."""
        return self.inner.steep

    @property
    def period(self) -> Any:
        """Return the period of the forcing (s), or `None`."""
        return self.inner.period

    @property
    def breakpoints(self) -> Any:
        """Return the times at which a function may change abruptly (s), or `None`."""
        return self.inner.breakpoints

    def constraint_name(self, number: int) -> str:
        """Return the name of a constraint."""
        return self.inner.constraint_name(number)

    def prepared(self) -> "Wrapping":
        """Return the same system around the prepared inner system."""
        return eqx.tree_at(lambda s: s.inner, self, self.inner.prepared())

    def check(self) -> None:
        """Raise `ValueError` if a parameter of the inner system has an unphysical
        value.
        """
        self.inner.check()


class SwitchedWrapping(Wrapping, SwitchedSystem):
    """A system that contains a `SwitchedSystem`, `inner`, and keeps its switching
    surfaces, branches, resets and contact friction as well.

    Examples:
        >>> from jaxcam.hybrid import SwitchedWrapping
        >>> from jaxcam.models import BilinearOscillator
        >>> class Braked(SwitchedWrapping):
        ...     base: jaxcam.SwitchedSystem
        ...     @property
        ...     def inner(self):
        ...         return self.base
        ...     def branch(self, t, state, sides):
        ...         braking = jnp.stack([0.0, -0.1 * state[1]])
        ...         return self.base.branch(t, state, sides) + braking
        >>> Braked(BilinearOscillator()).switching(0.0, jnp.array([0.5, 0.0])).shape
        ()
    """

    @property
    @abc.abstractmethod
    def inner(self) -> SwitchedSystem:
        """Return the system inside."""

    def switching(self, t, state):
        """Return the switching functions of the inner system."""
        return self.inner.switching(t, state)

    def distances(self, t, state, sides):
        """Return the distances of the inner system."""
        return self.inner.distances(t, state, sides)

    def branch(self, t, state, sides):
        """Return the rates of the inner system."""
        return self.inner.branch(t, state, sides)

    def forced(self, rate, pushed, sides):
        """Return the rates of the inner system with added forces."""
        return self.inner.forced(rate, pushed, sides)

    def sides(self, t, state):
        """Return the sides of the inner system."""
        return self.inner.sides(t, state)

    def reset(self, t, state, sides):
        """Return the states after the resets of the inner system."""
        return self.inner.reset(t, state, sides)

    def gap(self, t, state):
        """Return the gaps of the inner system."""
        return self.inner.gap(t, state)

    def impact(self, t, state):
        """Return the states after the impacts of the inner system."""
        return self.inner.impact(t, state)

    def sides_changed(self, number: int) -> tuple[tuple[int, ...], ...]:
        """Return, for each surface, the surfaces whose sides change at its crossing."""
        return self.inner.sides_changed(number)

    def remembered_sides(self, number: int) -> Int[np.ndarray, "discrete k"]:
        """Return the sides that depend on the past, in each discrete state."""
        return self.inner.remembered_sides(number)

    def met_surfaces(self, number: int) -> Bool[np.ndarray, "discrete k"]:
        """Return which surfaces a motion can cross in each discrete state."""
        return self.inner.met_surfaces(number)

    @property
    def one_way(self) -> int:
        """Return the number of transitions between modes."""
        return self.inner.one_way

    @property
    def remembers(self) -> bool:
        """Return whether the sides depend on the past."""
        return self.inner.remembers

    @property
    def hysteresis(self) -> Any:
        """Return the hysteresis of each surface."""
        return self.inner.hysteresis

    @property
    def holding(self) -> Any:
        """Return the ratio of static to kinetic friction at each surface."""
        return self.inner.holding

    @property
    def has_contact_friction(self) -> bool:
        """Return whether the contacts have friction."""
        return self.inner.has_contact_friction

    def contact_friction(self, t, state, sides):
        """Return the friction of each contact."""
        return self.inner.contact_friction(t, state, sides)

    @property
    def restitution_kind(self):
        """Return the meaning of the coefficient of restitution."""
        return self.inner.restitution_kind
