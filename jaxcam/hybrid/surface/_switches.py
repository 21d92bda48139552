"""The branches of a switched system, its switching functions and its resets."""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._switched import SwitchedSystem
from .._system import HybridSystem
from .._types import RealScalar, State
from .._wrapping import Wrapping


class OnSides(Wrapping):
    """A switched system on fixed sides of its surfaces: one branch of its field."""

    system: SwitchedSystem
    """The system."""
    negative: Bool[Array, " k"]
    """Whether the motion is on the negative side of each surface, shape `(k,)`."""

    @property
    def inner(self) -> SwitchedSystem:
        """Return the system."""
        return self.system

    def vector_field(self, t: RealScalar, state: State) -> State:
        """Return the rates of the branch."""
        return self.system.branch(t, state, self.signs)

    def gap(self, t: RealScalar, state: State) -> Float[Array, "*constraints"]:
        """Return the gaps of the system."""
        return self.system.gap(t, state)

    def impact(self, t: RealScalar, state: State) -> Float[Array, "*constraints n"]:
        """Return the states after impacts of the system."""
        return self.system.impact(t, state)

    @property
    def signs(self) -> Float[Array, " k"]:
        """The sides, +1 or -1, shape `(k,)`."""
        return jnp.where(self.negative, -1.0, 1.0)


def surfaces(system: HybridSystem, t, x) -> Float[Array, " k"]:
    """Return all switching functions as a vector, empty for a system without any.

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        Values, shape `(k,)`.

    Examples:
        >>> from jaxcam.hybrid.surface import surfaces
        >>> from jaxcam.models import BouncingBall
        >>> surfaces(BouncingBall(), 0.0, jnp.array([1.0, 0.0])).shape
        (0,)
    """
    if not isinstance(system, SwitchedSystem):
        return jnp.zeros((0,))
    return jnp.atleast_1d(system.switching(t, x))


def resets(mode: OnSides, t, x) -> Float[Array, "k n"]:
    """Return the state after the crossing of each surface, one row for each."""
    return jnp.atleast_2d(mode.system.reset(t, x, mode.signs))
