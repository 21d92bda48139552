"""A block on an inclined plane that vibrates."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import SwitchedSystem
from ._parameters import (
    parameter,
    require_finite,
    require_not_negative,
    require_positive,
    require_restitution,
)


class InclinedShaker(SwitchedSystem):
    """A block that slides, sticks and bounces on a vibrating inclined plane.

    The plane moves by `amplitude sin(omega t)` along a line at the angle `direction` to
    the plane. The state is (downhill position, height, and their velocities), relative
    to the plane. In contact, the friction force is at most `friction_coefficient` times
    the normal force, and `static` times that while the block sticks; in an impact, the
    friction impulse is at most `friction_coefficient` times the normal impulse.

    I. I. Blekhman, Vibrational Mechanics, World Scientific (2000).

    Examples:
        >>> from jaxcam.models import InclinedShaker
        >>> plane = InclinedShaker(incline=0.2, friction_coefficient=0.3, amplitude=0.0)
        >>> run = jaxcam.simulate(plane, [0.0, 0.0, 1.0, 0.0], 0.0, 3.0)
        >>> run.switches.time.round(6).tolist()
        [1.069073]
        >>> abs(run.final[2].item()) < 1e-15
        True
    """

    state_names: ClassVar[tuple[str, ...]] = (
        "position",
        "height",
        "velocity",
        "height_rate",
    )
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("m", "m", "m/s", "m/s")
    """Units of the state components."""

    incline: jax.Array = parameter(0.1)
    """Angle of the plane to the horizontal (rad)."""
    friction_coefficient: jax.Array = parameter(0.3)
    """Coefficient of kinetic friction."""
    static: jax.Array = parameter(1.0)
    """Ratio of the static to the kinetic coefficient of friction, at least 1."""
    restitution: jax.Array = parameter(0.5)
    """Coefficient of restitution, between 0 and 1."""
    amplitude: jax.Array = parameter(0.002)
    """Amplitude of the vibration (m)."""
    omega: jax.Array = parameter(50.0)
    """Angular frequency of the vibration (rad/s)."""
    direction: jax.Array = parameter(0.5)
    """Angle between the direction of vibration and the plane (rad)."""
    gravity: jax.Array = parameter(9.81)
    """Acceleration due to gravity (m/s^2)."""

    def switching(self, t, state) -> jax.Array:
        """Return the velocity along the plane (m/s)."""
        del t
        return state[2]

    def branch(self, t, state, sides) -> jax.Array:
        """Return the velocities and accelerations without contact, shape `(4,)`."""
        del sides
        push = self.amplitude * self.omega**2 * jnp.sin(self.omega * t)
        along = self.gravity * jnp.sin(self.incline) + push * jnp.cos(self.direction)
        up = push * jnp.sin(self.direction) - self.gravity * jnp.cos(self.incline)
        return jnp.stack([state[2], state[3], along, up])

    def contact_friction(self, t, state, sides) -> jax.Array:
        """Return the friction per unit of the normal force, shape `(4,)`."""
        del t
        return jnp.zeros_like(state).at[2].set(-self.friction_coefficient * sides[0])

    @property
    def holding(self) -> jax.Array:
        """Ratio of the static to the kinetic coefficient of friction."""
        return self.static

    def gap(self, t, state) -> jax.Array:
        """Return the height above the plane (m), a scalar."""
        del t
        return state[1]

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact without friction, shape `(4,)`."""
        del t
        return state.at[3].multiply(-self.restitution)

    @property
    def period(self) -> jax.Array:
        """Period of the vibration (s)."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(omega=self.omega, gravity=self.gravity)
        require_restitution(self.restitution)
        require_finite(incline=self.incline, direction=self.direction)
        require_not_negative(
            friction_coefficient=self.friction_coefficient, amplitude=self.amplitude
        )
