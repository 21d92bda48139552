"""The forced linear oscillator with a rigid wall."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem
from ._parameters import (
    parameter,
    require_finite,
    require_not_negative,
    require_positive,
    require_restitution,
)


class ImpactOscillator(HybridSystem):
    """Forced linear oscillator with a rigid wall, dimensionless.

    `x'' + 2 damping x' + x = cos(omega t)` with `x <= wall`; the state is (x, x'). Many
    of its periodic orbits and their bifurcations are known in closed form.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> float(ImpactOscillator(wall=0.5).gap(0.0, jnp.array([0.2, 0.0])))
        0.3
    """

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-")
    """Units of the state components."""

    omega: jax.Array = parameter(2.8)
    """Angular frequency of the forcing."""
    restitution: jax.Array = parameter(0.8)
    """Coefficient of restitution at the wall, between 0 and 1."""
    wall: jax.Array = parameter(0.0)
    """Position of the wall."""
    damping: jax.Array = parameter(0.0)
    """Damping ratio."""

    def vector_field(self, t, state) -> jax.Array:
        """Return velocity and acceleration, shape `(2,)`."""
        x, velocity = state[0], state[1]
        acceleration = jnp.cos(self.omega * t) - x - 2 * self.damping * velocity
        return jnp.stack([velocity, acceleration])

    def gap(self, t, state) -> jax.Array:
        """Return the distance to the wall, a scalar."""
        del t
        return self.wall - state[0]

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact; the velocity is multiplied by
        -restitution.
        """
        del t
        return jnp.stack([state[0], -self.restitution * state[1]])

    @property
    def period(self) -> jax.Array:
        """Period of the forcing."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(omega=self.omega)
        require_restitution(self.restitution)
        require_finite(wall=self.wall)
        require_not_negative(damping=self.damping)
