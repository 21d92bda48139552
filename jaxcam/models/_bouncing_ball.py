"""A ball on a floor that may vibrate."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem
from ._parameters import (
    parameter,
    require_finite,
    require_positive,
    require_restitution,
)


class BouncingBall(HybridSystem):
    """A ball in free fall above a floor that moves as `amplitude sin(frequency t)`.

    The state is the height above the mean position of the floor and the velocity (m,
    m/s).

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> BouncingBall().impact(0.0, jnp.array([0.0, -1.0])).tolist()
        [0.0, 0.8]
    """

    state_names: ClassVar[tuple[str, ...]] = ("height", "velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("m", "m/s")
    """Units of the state components."""

    gravity: jax.Array = parameter(9.81)
    """Acceleration due to gravity (m/s^2)."""
    restitution: jax.Array = parameter(0.8)
    """Coefficient of restitution, between 0 and 1."""
    amplitude: jax.Array = parameter(0.0)
    """Amplitude of the floor motion (m); zero for a floor at rest."""
    frequency: jax.Array = parameter(1.0)
    """Angular frequency of the floor motion (rad/s)."""

    def vector_field(self, t, state) -> jax.Array:
        """Return velocity and acceleration, shape `(2,)`."""
        del t
        return jnp.stack([state[1], -self.gravity])

    def gap(self, t, state) -> jax.Array:
        """Return the height above the floor (m), a scalar."""
        return state[0] - self.amplitude * jnp.sin(self.frequency * t)

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact; the velocity relative to the floor is
        multiplied by -restitution.
        """
        floor_velocity = self.amplitude * self.frequency * jnp.cos(self.frequency * t)
        velocity = state[1] - floor_velocity
        return jnp.stack([state[0], state[1] - (1 + self.restitution) * velocity])

    @property
    def period(self) -> jax.Array:
        """Period of the floor motion (s), even if its amplitude is zero."""
        return 2 * jnp.pi / self.frequency

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(gravity=self.gravity, frequency=self.frequency)
        require_restitution(self.restitution)
        require_finite(amplitude=self.amplitude)
