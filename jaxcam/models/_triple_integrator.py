"""The simplest system that leaves chatter at a release point."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem
from ._parameters import parameter, require_restitution


class TripleIntegrator(HybridSystem):
    """`x' = v`, `v' = a`, `a' = 1` above `x = 0`; state (x, v, a) (thesis,
    eqs. 6.22-6.24).

    It is what any impacting system looks like close to the release point of a sticking
    orbit, with the jerk there scaled to one: started with a negative acceleration it
    chatters, and if it comes to rest it lifts off where the acceleration is zero.
    """

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity", "acceleration")
    state_units: ClassVar[tuple[str, ...]] = ("-", "-", "-")

    restitution: jax.Array = parameter(0.8)
    """Coefficient of restitution, between 0 and 1."""

    def vector_field(self, t, state) -> jax.Array:
        """Velocity, acceleration and the unit jerk, shape `(3,)` (thesis, eq. 6.22)."""
        del t
        return jnp.stack([state[1], state[2], jnp.ones_like(state[2])])

    def gap(self, t, state) -> jax.Array:
        """Position, a scalar (thesis, eq. 6.23)."""
        del t
        return state[0]

    def impact(self, t, state) -> jax.Array:
        """State after an impact: the velocity is multiplied by -restitution (thesis,
        eq. 6.24).
        """
        del t
        return jnp.stack([state[0], -self.restitution * state[1], state[2]])

    def check(self) -> None:
        """Raise `ValueError` where the restitution has no physical meaning."""
        require_restitution(self.restitution)
