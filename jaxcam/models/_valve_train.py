"""A valve, or any translating mass, pressed onto a cam by a spring."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp

from ._cam_driven import AbstractCamDriven
from ._parameters import (
    as_parameter,
    parameter,
    require_finite,
    require_not_negative,
    require_positive,
)
from ._restitution import ConstantRestitution
from .cams import CamProfile


class ValveTrain(AbstractCamDriven):
    """A translating follower on a cam that turns at constant speed: m x'' + c x' + k x
    + F0 = Fc.

    Fc is the contact force. The state is the lift and velocity of the follower (m,
    m/s); the gap is the distance between the follower and the cam.

    Examples:
        >>> from jaxcam.models import MotionProgram, Segment, ValveTrain
        >>> rises = (0.01, -0.01)
        >>> program = MotionProgram([Segment("cycloidal", np.pi, r) for r in rises])
        >>> valve = ValveTrain(program, 100.0, mass=0.1, stiffness=2e4, preload=200.0)
        >>> round(float(valve.period), 6)
        0.062832
    """

    state_names: ClassVar[tuple[str, ...]] = ("lift", "valve velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("m", "m/s")
    """Units of the state components."""

    profile: CamProfile
    """Lift (m) as a function of the cam angle, such as a
    [`jaxcam.models.MotionProgram`][].
    """
    speed: jax.Array = parameter()
    """Speed of the cam (rad/s), half the crankshaft speed of a four-stroke engine."""
    mass: jax.Array = parameter()
    """Mass that moves with the valve (kg), including a third of the spring mass."""
    stiffness: jax.Array = parameter()
    """Stiffness of the valve spring (N/m)."""
    preload: jax.Array = parameter()
    """Force of the spring at zero lift (N)."""
    damping: jax.Array = parameter(0.0)
    """Viscous damping (N s/m)."""
    restitution: eqx.Module = eqx.field(
        default_factory=lambda: ConstantRestitution(as_parameter(0.5))
    )
    """Restitution law `r(speed, approach_speed)`, with the approach speed in m/s."""
    phase: jax.Array = parameter(0.0)
    """Angle of the cam at time zero (rad)."""

    def vector_field(self, t, state) -> jax.Array:
        """Return velocity and acceleration of the free valve, shape `(2,)`."""
        del t
        lift, velocity = state[0], state[1]
        force = self.stiffness * lift + self.preload + self.damping * velocity
        return jnp.stack([velocity, -force / self.mass])

    def gap(self, t, state) -> jax.Array:
        """Return the distance between follower and cam (m), a scalar."""
        return state[0] - self.profile(self.cam_angle(t))

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact, in which the relative velocity v becomes -r
        v.
        """
        return self.after_impact(t, state)

    def load_terms(self, lift, slope, curvature):
        """Return a, b and c of the contact force `a w^2 + b w + c` (N) at speed w.

        `lift`, `slope` and `curvature` are the lift of the profile and its first and
        second derivatives with respect to the cam angle.
        """
        return (
            self.mass * curvature,
            self.damping * slope,
            self.stiffness * lift + self.preload,
        )

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(speed=self.speed, mass=self.mass)
        require_not_negative(
            stiffness=self.stiffness, preload=self.preload, damping=self.damping
        )
        require_finite(phase=self.phase)
        self.check_cam()
