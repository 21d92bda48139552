"""The cam-follower rig of the thesis: a spring-loaded follower on a rotating cam."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from ._cam_driven import AbstractCamDriven
from ._parameters import (
    parameter,
    require_finite,
    require_positive,
)
from ._restitution import LinearInSpeed
from ._units import rpm_to_rad_s
from .cams import CamProfile, EccentricCircle


_SENSE = {"clockwise": -1.0, "counterclockwise": 1.0}


class CamFollower(AbstractCamDriven):
    """A hinged follower pressed by a spring onto a cam that turns at constant speed.

    The state is the angle and velocity of the follower (rad, rad/s); the gap is the
    follower angle minus the contact angle (rad). The defaults are those of the thesis,
    Table 4.4, as printed, at 145 rpm.

    Raises:
        ValueError: `rotation` is neither "clockwise" nor "counterclockwise".

    Examples:
        >>> from jaxcam.models import CamFollower, rpm_to_rad_s
        >>> rig = CamFollower(speed=rpm_to_rad_s(150.0))
        >>> round(float(rig.period), 6)
        0.4
    """

    state_names: ClassVar[tuple[str, ...]] = ("follower angle", "follower velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("rad", "rad/s")
    """Units of the state components."""

    speed: jax.Array = parameter(rpm_to_rad_s(145.0))
    """Speed of the cam (rad/s)."""
    phase: jax.Array = parameter(0.0)
    """Cam angle at time zero (rad)."""
    inertia: jax.Array = parameter(0.043)
    """Moment of inertia of the follower about its hinge, J (kg m^2)."""
    stiffness: jax.Array = parameter(105.0)
    """Spring coefficient K (N/m)."""
    spring_hook_x: jax.Array = parameter(-0.031)
    """x-coordinate of the suspension point of the spring, x_A (m)."""
    spring_elongation: jax.Array = parameter(0.173)
    """Elongation of the spring, y_A - d_0 - d_1 in the notation of the thesis (m)."""
    spring_half_height: jax.Array = parameter(0.021)
    """Half height d in the spring torque (m). The half height that determines the
    contact angle belongs to the profile, so that both can be fitted separately.
    """
    profile: CamProfile = eqx.field(default_factory=EccentricCircle)
    """Contact angle as a function of the cam angle, a
    [`jaxcam.models.CamProfile`][].
    """
    restitution: eqx.Module = eqx.field(default_factory=LinearInSpeed)
    """Restitution law `r(speed, approach_speed)`, an equinox module; the approach speed
    is in rad/s.
    """
    rotation: str = eqx.field(default="clockwise", static=True)
    """"clockwise" or "counterclockwise". The tables of the thesis require a cam that
    turns clockwise, although angles in its Table 4.3 are positive counterclockwise.
    """

    def __check_init__(self):
        if self.rotation not in _SENSE:
            raise ValueError(
                'Choose "clockwise" or "counterclockwise" for `rotation`; it is '
                f"{self.rotation!r}."
            )

    def vector_field(self, t, state) -> jax.Array:
        """Return the velocity and acceleration of the free follower, `(2,)` (thesis,
        eq. 4.9).
        """
        del t
        angle, velocity = state[0], state[1]
        # this uses only one sine and one cosine, because it is evaluated in every
        # Runge-Kutta stage
        sine, cosine = jnp.sin(angle), jnp.cos(angle)
        secant = 1 / cosine
        stretch = self._reach(sine, secant) - self.spring_elongation
        arm = (self.spring_hook_x + self.spring_half_height * sine) * secant * secant
        acceleration = -(self.stiffness / self.inertia) * stretch * arm
        return jnp.stack([velocity, acceleration])

    def gap(self, t, state) -> jax.Array:
        """Return the angle between follower and cam (rad), a scalar."""
        return state[0] - self.contact_angle(self.cam_angle(t))

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact: v becomes -r v (thesis, eq. 6.111)."""
        return self.after_impact(t, state)

    def cam_angle(self, t) -> jax.Array:
        """Return the cam angle (rad) at `t` (s), positive counterclockwise,
        elementwise.
        """
        return _SENSE[self.rotation] * (self.speed * t + self.phase)

    @property
    def cam_velocity(self) -> jax.Array:
        """Rate of change of the cam angle (rad/s)."""
        return _SENSE[self.rotation] * self.speed

    def contact_angle(self, cam_angle) -> jax.Array:
        """Return the follower angle (rad) in contact at `cam_angle` (rad) (thesis,
        eq. 4.23).
        """
        return self.profile(cam_angle)

    def potential_energy(self, follower_angle) -> jax.Array:
        """Return the energy of the spring (J) at `follower_angle` (rad) (thesis, eq.
        4.8).
        """
        reach = self._reach(jnp.sin(follower_angle), 1 / jnp.cos(follower_angle))
        return 0.5 * self.stiffness * (reach - self.spring_elongation) ** 2

    def load_terms(self, lift, slope, curvature):
        """Return a, b and c of the contact torque `a w^2 + b w + c` (N m) at speed w.

        `lift`, `slope` and `curvature` are the lift of the profile and its first and
        second derivatives with respect to the cam angle (thesis, eq. 4.10).
        """
        at_rest = jnp.stack([lift, jnp.zeros_like(lift)])
        spring = -self.inertia * self.vector_field(0.0, at_rest)[1]
        return self.inertia * curvature, jnp.zeros_like(slope), spring

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(
            speed=self.speed, inertia=self.inertia, stiffness=self.stiffness
        )
        require_finite(
            phase=self.phase,
            spring_hook_x=self.spring_hook_x,
            spring_elongation=self.spring_elongation,
            spring_half_height=self.spring_half_height,
        )
        self.check_cam()

    def _reach(self, sine, secant):
        # x_A tan(theta) + d / cos(theta), the position of the spring's end on the
        # follower
        return (self.spring_hook_x * sine + self.spring_half_height) * secant
