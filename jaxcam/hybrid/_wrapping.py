"""A system built around another one, whose declarations it keeps."""

import abc
from typing import Any

import equinox as eqx

from ._system import HybridSystem


class Wrapping(HybridSystem):
    """A system that contains another one, `inner`, and forwards what that declares: its
    period, breakpoints, names, `active`, preparation and check.

    Subclass it to change some of the functions of any system: store the system in a
    field and return it from the property `inner`. Override a declaration only if it
    differs from that of the inner system. Around a `SwitchedSystem`, the subclass must
    be one as well; otherwise, it has no switching surfaces.

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
