"""A gear that rattles within its backlash."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem
from ._parameters import (
    parameter,
    require_not_negative,
    require_positive,
    require_restitution,
)


class RattlingGear(HybridSystem):
    """Loose gear between the rigid teeth of a driving gear, dimensionless.

    The driving gear turns at a constant speed, on which a vibration of displacement
    `amplitude cos(omega t)` along the line of action is superposed. The displacement y
    of the loose gear follows `y'' = -drag - damping y'`, where `drag` is the torque of
    the bearings and the oil at constant speed. The state is (x, x') with x = amplitude
    cos(omega t) - y, the transmission error. The teeth hit each other on the driving
    flank at x = clearance and on the opposite flank at x = -clearance; the relative
    velocity x' is then multiplied by -restitution. As long as the acceleration of the
    driving gear is too small, the drag holds the loose gear at the driving flank.

    Between impacts, the motion is known in closed form, and so are the periodic motions
    with one impact per period, or one on each flank. The gear pair with elastic teeth
    is [`jaxcam.models.GearBacklash`][].

    K. Karagiannis, F. Pfeiffer, Theoretical and experimental investigations of
    gear-rattling, Nonlinear Dynamics 2 (1991), 367-387.

    Examples:
        >>> import continuation
        >>> from jaxcam.models import RattlingGear
        >>> orbit = continuation.periodic_orbit(RattlingGear())
        >>> np.asarray(orbit.impacts.constraint).tolist()  # one impact on each flank
        [0, 1]
    """

    state_names: ClassVar[tuple[str, ...]] = ("transmission error", "velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-")
    """Units of the state components."""
    constraint_names: ClassVar[tuple[str, ...]] = ("driving flank", "opposite flank")
    """Names of the constraints."""

    clearance: jax.Array = parameter(1.0)
    """Half the backlash."""
    drag: jax.Array = parameter(0.1)
    """Deceleration of the loose gear by the drag torque at constant speed."""
    damping: jax.Array = parameter(0.05)
    """Rate at which viscous drag reduces the loose gear's velocity."""
    amplitude: jax.Array = parameter(1.0)
    """Amplitude of the vibration of the driving gear."""
    omega: jax.Array = parameter(1.0)
    """Angular frequency of the vibration."""
    restitution: jax.Array = parameter(0.7)
    """Coefficient of restitution on both flanks, between 0 and 1."""

    def vector_field(self, t, state) -> jax.Array:
        """Return velocity and acceleration, shape `(2,)`."""
        phase = self.omega * t
        driving = -self.amplitude * self.omega * jnp.sin(phase)
        acceleration = -self.amplitude * self.omega**2 * jnp.cos(phase)
        loose = -self.drag - self.damping * (driving - state[1])
        return jnp.stack([state[1], acceleration - loose])

    def gap(self, t, state) -> jax.Array:
        """Return the distances from the driving and the opposite flank."""
        del t
        return jnp.stack([self.clearance - state[0], self.clearance + state[0]])

    def impact(self, t, state) -> jax.Array:
        """Return the states after impacts, shape `(2, 2)`; the velocity is multiplied
        by -restitution.
        """
        del t
        after = jnp.stack([state[0], -self.restitution * state[1]])
        return jnp.stack([after, after])

    @property
    def period(self) -> jax.Array:
        """Period of the vibration."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(omega=self.omega, clearance=self.clearance)
        require_restitution(self.restitution)
        require_not_negative(
            drag=self.drag, damping=self.damping, amplitude=self.amplitude
        )
