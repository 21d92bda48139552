"""Contact load on a cam, and the speed at which contact is lost."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from ._cam_follower import CamFollower
from ._valve_train import ValveTrain
from .cams import flat_oscillating_contour, MotionPieces, MotionProgram, profile_jet


_TURN = 2 * np.pi
_SAMPLES = 1025
_HALVINGS = 60
"""Number of golden-section iterations, which shrink an interval of two scan steps to
rounding error.
"""
_GOLDEN = (5**0.5 - 1) / 2


class FloatSpeed(NamedTuple):
    """The lowest speed at which a follower leaves its cam, and the cam angle there."""

    speed: Float[Array, ""]
    """Speed (rad/s); infinite if the follower never leaves the cam."""
    cam_angle: Float[Array, ""]
    """Cam angle (rad)."""


def contact_load(
    system: CamFollower | ValveTrain, cam_angles: Float[ArrayLike, " angles"]
) -> Float[Array, " angles"]:
    """Return the load that the cam must exert for permanent contact.

    The load at the speed of the system is a torque (N m) about the hinge of a
    [`jaxcam.models.CamFollower`][], or a force (N) on a [`jaxcam.models.ValveTrain`][]
    (thesis, eq. 4.10). Contact is lost where the load would have to be negative.

    Args:
        system: The system.
        cam_angles: Cam angles (rad), counted as in the profile, shape
            `(angles,)`.

    Returns:
        Loads, shape `(angles,)`.

    Examples:
        >>> from jaxcam.models import CamFollower, contact_load
        >>> contact_load(CamFollower(), jnp.zeros(3)).shape
        (3,)
    """
    profile = system.profile.prepared()
    jets = jax.vmap(lambda angle: _jet(profile, angle))(jnp.asarray(cam_angles))
    square, linear, constant = system.load_terms(*jets)
    return (square * system.speed + linear) * system.speed + constant


def contact_force(
    system: CamFollower | ValveTrain,
    cam_angles: Float[ArrayLike, " angles"],
    *,
    center: tuple | None = None,
) -> Float[Array, " angles"]:
    """Return the normal contact force (N).

    For a hinged follower, this is the torque divided by the lever arm, which is l in
    the thesis, eq. 4.19.

    Args:
        system: The system.
        cam_angles: Cam angles (rad), counted as in the profile, shape
            `(angles,)`.
        center: Position of the cam axis relative to the hinge (m); not required for an
            eccentric circle, which defines it.

    Returns:
        Contact forces, shape `(angles,)`.

    Raises:
        ValueError: The axis is unknown.

    Examples:
        >>> from jaxcam.models import CamFollower, contact_force
        >>> contact_force(CamFollower(), jnp.zeros(3)).shape
        (3,)
    """
    load = contact_load(system, cam_angles)
    if isinstance(system, ValveTrain):
        return load
    half_height = getattr(system.profile, "half_height", system.spring_half_height)
    contour = flat_oscillating_contour(
        system.profile, cam_angles, center=center, half_height=half_height
    )
    return load / contour.arm


def float_speed(system: CamFollower | ValveTrain) -> FloatSpeed:
    """Return the lowest speed of valve float, at which the contact force would have to
    be tensile.

    It is the smallest root, over all cam angles, of the contact load as a function of
    the speed. At the joints of a motion program, the accelerations on both sides are
    considered; if the slope of the lift jumps down at a joint, the follower leaves the
    cam at any speed. The result is differentiable in the parameters.

    Args:
        system: The system.

    Returns:
        A `FloatSpeed`.

    Examples:
        >>> from jaxcam.models import float_speed, preset, rad_s_to_rpm
        >>> found = float_speed(preset("calibrated"))
        >>> round(float(rad_s_to_rpm(found.speed)), 1)
        125.2
    """
    profile = system.profile.prepared()
    start, end = _pieces(profile)

    def speed_at(piece, angle):
        a, b, c = system.load_terms(*_jet(profile, angle, piece))
        return _least_root(a, b, c)

    grid = np.linspace(0.0, 1.0, _SAMPLES)
    spans = (end - start)[:, None]
    angles = start[:, None] + spans * grid[None]
    pieces = np.arange(start.shape[0])
    over = jax.vmap(jax.vmap(speed_at, in_axes=(None, 0)))
    speeds = over(pieces, angles)
    best = jnp.argmin(speeds)
    piece, step = best // _SAMPLES, best % _SAMPLES
    step = jnp.clip(step, 1, _SAMPLES - 2)
    low, high = angles[piece, step - 1], angles[piece, step + 1]

    def shrink(_, ends):
        low, high = ends
        left = high - _GOLDEN * (high - low)
        right = low + _GOLDEN * (high - low)
        lower = speed_at(piece, left) <= speed_at(piece, right)
        return jnp.where(lower, low, left), jnp.where(lower, right, high)

    low, high = jax.lax.fori_loop(0, _HALVINGS, shrink, (low, high))
    refined = (low + high) / 2
    coarse = angles.reshape(-1)[best]
    better = speed_at(piece, refined) < speed_at(piece, coarse)
    # a shift of the minimum does not change its value to first order, so its position
    # is not differentiated
    angle = jax.lax.stop_gradient(jnp.where(better, refined, coarse))
    speed = speed_at(piece, angle)
    fall, where = _sharpest_fall(system.profile)
    lost = fall < 0
    return FloatSpeed(jnp.where(lost, 0.0, speed), jnp.where(lost, where, angle))


def _jet(profile, angle, piece=None):
    if isinstance(profile, MotionPieces):
        piece = profile.local(angle)[0] if piece is None else piece
        jet = profile.jet(piece, angle)
        return jet[..., 0], jet[..., 1], jet[..., 2]
    return profile_jet(profile, angle)


def _pieces(profile):
    if isinstance(profile, MotionPieces):
        return profile.starts, profile.ends()
    return jnp.zeros(1), jnp.full(1, _TURN)


def _least_root(a, b, c):
    """Return the smallest positive root of a w^2 + b w + c for c > 0; infinite if there
    is none.
    """
    discriminant = b * b - 4 * a * c
    real = discriminant >= 0
    divisor = jnp.sqrt(jnp.where(real, discriminant, 1.0)) - b
    found = real & (divisor > 0)
    root = 2 * c / jnp.where(found, divisor, 1.0)
    return jnp.where(c <= 0, 0.0, jnp.where(found, root, jnp.inf))


def _sharpest_fall(profile):
    """Return the most negative jump of the slope of the profile, and its cam angle.

    A convex kink throws the follower off for either sense of rotation.
    """
    if not isinstance(profile, MotionProgram):
        return jnp.zeros(()), jnp.zeros(())
    angles, jumps = profile.joints()
    # smaller jumps are rounding errors of the slopes
    scale = 1e-9 * jnp.max(jnp.abs(profile.rises / profile.widths))
    falls = jnp.where(jumps[:, 1] < -scale, jumps[:, 1], 0.0)
    first = jnp.argmin(falls)
    return falls[first], angles[first]
