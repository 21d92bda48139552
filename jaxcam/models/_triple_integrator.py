"""The simplest system with chatter and a release point."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem
from ._parameters import parameter, require_restitution


class TripleIntegrator(HybridSystem):
    """Triple integrator above a floor: `x' = v`, `v' = a`, `a' = 1` for `x > 0`.

    The state is (x, v, a) (thesis, eqs. 6.22-6.24). Every system with impacts has this
    form close to the release point of a sticking orbit, with the jerk at release scaled
    to one. Starting with a negative acceleration, it chatters; once in contact, it is
    released when the acceleration reaches zero.

    Examples:
        >>> from jaxcam.models import TripleIntegrator
        >>> TripleIntegrator().vector_field(0.0, jnp.array([0.0, 1.0, -2.0])).tolist()
        [1.0, -2.0, 1.0]
    """

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity", "acceleration")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-", "-")
    """Units of the state components."""

    restitution: jax.Array = parameter(0.8)
    """Coefficient of restitution, between 0 and 1."""

    def vector_field(self, t, state) -> jax.Array:
        """Return velocity, acceleration and the unit jerk, `(3,)` (thesis,
        eq. 6.22).
        """
        del t
        return jnp.stack([state[1], state[2], jnp.ones_like(state[2])])

    def gap(self, t, state) -> jax.Array:
        """Return the position, a scalar (thesis, eq. 6.23)."""
        del t
        return state[0]

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact, in which v becomes -restitution v (thesis,
        eq. 6.24).
        """
        del t
        return jnp.stack([state[0], -self.restitution * state[1], state[2]])

    def check(self) -> None:
        """Raise `ValueError` if the coefficient of restitution is invalid."""
        require_restitution(self.restitution)
