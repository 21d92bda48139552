"""Filippov systems, with one vector field on either side of a surface."""

import abc
from typing import Any, ClassVar

import equinox as eqx
from jaxtyping import Array, Float


class FilippovSystem(eqx.Module):
    """A system whose vector field jumps across a surface (thesis, eq. 2.19).

    Subclass it and define the three methods below, which must be smooth in time and
    state, even beyond the surface. Every floating-point field is a parameter. The state
    never jumps. In a [`jaxcam.hybrid.HybridSystem`][], by contrast, the surface is
    never crossed, and contact imposes two conditions on the state (gap and normal
    velocity) and begins with an impact. Here, the motion can be on both sides, and
    sliding imposes one condition. The two kinds therefore have separate event loops.

    Examples:
        >>> from jaxcam.filippov import FilippovSystem, simulate_filippov
        >>> class Relay(FilippovSystem):
        ...     def above(self, t, state):
        ...         return -jnp.ones(1)
        ...     def below(self, t, state):
        ...         return jnp.ones(1)
        ...     def switching(self, t, state):
        ...         return state[0]
        >>> round(float(simulate_filippov(Relay(), [0.5], 0.0, 1.0).final[0]), 6) + 0.0
        0.0
    """

    state_names: ClassVar[tuple[str, ...]] = ()
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ()
    """Units of the state components."""

    @abc.abstractmethod
    def above(self, t, state: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the rate of change where `switching` is positive, shape `(n,)`."""

    @abc.abstractmethod
    def below(self, t, state: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the rate of change where `switching` is negative, shape `(n,)`."""

    @abc.abstractmethod
    def switching(self, t, state: Float[Array, " n"]) -> Float[Array, ""]:
        """Return the scalar H that is zero on the surface."""

    @property
    def period(self) -> Any:
        """Period of the forcing (s), or `None` for an autonomous system."""
        return None

    def check(self) -> None:
        """Raise `ValueError` if a parameter has no physical meaning."""
        return None
