"""Filippov systems, with one vector field on either side of a surface."""

import abc

import jax.numpy as jnp
from jaxtyping import Array, Float

from ..hybrid import SwitchedSystem


class FilippovSystem(SwitchedSystem):
    """A system whose vector field jumps across a surface (thesis, eq. 2.19).

    Subclass it and define the three methods below, which must be smooth in time and
    state, even beyond the surface. Every floating-point field is a parameter. The state
    never jumps.

    If the motion starts on the surface and both fields point away from it, the motion
    is not unique; the method `sides` then chooses the side, by default the one above.

    A Filippov system is a [`jaxcam.hybrid.SwitchedSystem`][] with one surface:
    `jaxcam.simulate`, `jaxcam.hybrid.stroboscope` and `continuation.periodic_orbit`
    accept it.

    Examples:
        >>> from jaxcam.filippov import FilippovSystem
        >>> class Relay(FilippovSystem):
        ...     def above(self, t, state):
        ...         return -jnp.ones(1)
        ...     def below(self, t, state):
        ...         return jnp.ones(1)
        ...     def switching(self, t, state):
        ...         return state[0]
        >>> round(float(jaxcam.simulate(Relay(), [0.5], 0.0, 1.0).final[0]), 6) + 0.0
        0.0
    """

    @abc.abstractmethod
    def above(self, t, state: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the rate of change where `switching` is positive, shape `(n,)`."""

    @abc.abstractmethod
    def below(self, t, state: Float[Array, " n"]) -> Float[Array, " n"]:
        """Return the rate of change where `switching` is negative, shape `(n,)`."""

    @abc.abstractmethod
    def switching(self, t, state: Float[Array, " n"]) -> Float[Array, ""]:
        """Return the switching function, a scalar that is zero on the surface."""

    def branch(self, t, state: Float[Array, " n"], sides) -> Float[Array, " n"]:
        """Return the rate of change on one side of the surface.

        Args:
            t: Time (s).
            state: State, shape `(n,)`.
            sides: +1 above the surface or -1 below it, shape `(1,)`.

        Returns:
            Rate of change of the state, shape `(n,)`.
        """
        return jnp.where(sides[0] > 0, self.above(t, state), self.below(t, state))
