"""A follower guided from both sides: the form-closed, or desmodromic, joint."""

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


class DesmodromicCam(AbstractCamDriven):
    """A translating follower between two flanks that move with the cam.

    The flanks prescribe the same lift from below and from above, with a clearance
    between them. There are two gaps, to the lower and to the upper flank. A spring is
    optional.

    Examples:
        >>> from jaxcam.models import DesmodromicCam, MotionProgram, Segment
        >>> rises = (0.01, -0.01)
        >>> program = MotionProgram([Segment("cycloidal", np.pi, r) for r in rises])
        >>> cam = DesmodromicCam(program, speed=10.0, clearance=1e-4)
        >>> cam.gap(0.0, jnp.array([5e-5, 0.0])).shape
        (2,)
    """

    state_names: ClassVar[tuple[str, ...]] = ("lift", "follower velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("m", "m/s")
    """Units of the state components."""
    constraint_names: ClassVar[tuple[str, ...]] = ("lower flank", "upper flank")
    """Names of the constraints."""

    profile: CamProfile
    """Lift (m) of the lower flank as a function of the cam angle."""
    speed: jax.Array = parameter()
    """Speed of the cam (rad/s)."""
    clearance: jax.Array = parameter()
    """Clearance of the follower between the flanks (m)."""
    mass: jax.Array = parameter(1.0)
    """Mass of the follower (kg)."""
    stiffness: jax.Array = parameter(0.0)
    """Stiffness of the spring (N/m)."""
    preload: jax.Array = parameter(0.0)
    """Force of the spring at zero lift (N)."""
    damping: jax.Array = parameter(0.0)
    """Viscous damping (N s/m)."""
    restitution: eqx.Module = eqx.field(
        default_factory=lambda: ConstantRestitution(as_parameter(0.5))
    )
    """Restitution law `r(speed, approach_speed)` of both flanks."""
    phase: jax.Array = parameter(0.0)
    """Angle of the cam at time zero (rad)."""

    def vector_field(self, t, state) -> jax.Array:
        """Return the velocity and acceleration between the flanks, shape `(2,)`."""
        del t
        force = self.stiffness * state[0] + self.preload + self.damping * state[1]
        return jnp.stack([state[1], -force / self.mass])

    def gap(self, t, state) -> jax.Array:
        """Return the distances to the lower and the upper flank (m), shape `(2,)`."""
        over = state[0] - self.profile(self.cam_angle(t))
        return jnp.stack([over, self.clearance - over])

    def impact(self, t, state) -> jax.Array:
        """Return the states after an impact on either flank, shape `(2, 2)`."""
        after = self.after_impact(t, state)
        return jnp.stack([after, after])

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(speed=self.speed, clearance=self.clearance, mass=self.mass)
        require_not_negative(stiffness=self.stiffness, damping=self.damping)
        require_finite(preload=self.preload, phase=self.phase)
        self.check_cam()
