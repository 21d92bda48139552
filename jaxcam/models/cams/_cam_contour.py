"""The shape of a cam that gives a follower its motion.

The cam turns counterclockwise about the origin of the fixed frame; a contour is given
in the frame of the cam, which coincides with the fixed one at cam angle zero.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ._eccentric_circle import EccentricCircle


class CamContour(NamedTuple):
    """A cam's shape; every field has shape `(angles,)`, one for each cam angle.

    A radius of curvature that is not positive means that the follower's motion cannot
    be had: the contour would cut itself off (undercutting). Choose a larger base
    circle, or a smaller roller.
    """

    x: Float[Array, " angles"]
    """Contact point in the frame of the cam (m)."""
    y: Float[Array, " angles"]
    radius_of_curvature: Float[Array, " angles"]
    """Positive where the contour is convex (m)."""
    pressure_angle: Float[Array, " angles"]
    """Between the contact force and the motion of the point where it acts (rad)."""
    arm: Float[Array, " angles"]
    """Lever of the contact force about the hinge (m); 1 for a translating follower."""


def flat_translating_contour(
    profile: Callable[[Any], Any], base_radius, cam_angles: Float[ArrayLike, " angles"]
) -> CamContour:
    """The cam of a flat-faced follower that slides along a line through its axis.

    **Arguments:** a profile whose lift is a length (m), the distance of the face from
    the axis at lift zero (m), and cam angles (rad).
    """

    def one(angle):
        lift, slope, curvature = _jet(profile, angle)
        height = base_radius + lift
        x, y = _turned(slope, height, -angle)
        zero = jnp.zeros_like(height)
        return CamContour(x, y, height + curvature, zero, jnp.ones_like(height))

    return jax.vmap(one)(jnp.asarray(cam_angles))


def flat_oscillating_contour(
    profile: Callable[[Any], Any],
    cam_angles: Float[ArrayLike, " angles"],
    *,
    center: tuple | None = None,
    half_height=None,
) -> CamContour:
    """The cam of a flat-faced follower hinged at the origin, as in the thesis' rig.

    The common normal meets the line from the hinge to the axis of the cam where both
    bodies have one velocity, which gives the contact point from lift and slope alone.

    Args:
        profile: Lift is the angle of the follower (rad).
        cam_angles: rad, shape `(angles,)`.
        center: The axis of the cam (x0, y0) from the hinge (m), and.
        half_height: Distance of the face from the hinge (m); both are known for an
            [`jaxcam.models.EccentricCircle`][] .

    Returns:
        The contour about the cam's axis.

    Raises:
        ValueError: Where the axis or the half height is not known.
    """
    if isinstance(profile, EccentricCircle):
        if center is None:
            center = (profile.center_x, profile.center_y)
        if half_height is None:
            half_height = profile.half_height
    if center is None or half_height is None:
        raise ValueError(
            "Give `center` and `half_height`: this profile does not know where the "
            "cam's axis and the follower's face are."
        )
    x0, y0 = center

    def one(angle):
        def contact(a):
            lift, slope, _ = _jet(profile, a)
            arm = (x0 * jnp.cos(lift) + y0 * jnp.sin(lift)) / (1 - slope)
            px = arm * jnp.cos(lift) + half_height * jnp.sin(lift) - x0
            py = arm * jnp.sin(lift) - half_height * jnp.cos(lift) - y0
            return jnp.stack(_turned(px, py, -a)), arm

        (point, arm), (rate, _) = jax.jvp(contact, (angle,), (jnp.ones_like(angle),))
        lift, slope, _ = _jet(profile, angle)
        # the face's own direction, seen from the cam, turns with slope - 1,
        # and the contact point runs along it against the way that it turns
        along = rate[0] * jnp.cos(lift - angle) + rate[1] * jnp.sin(lift - angle)
        pressure = jnp.arctan(half_height / arm)
        return CamContour(point[0], point[1], along / (1 - slope), pressure, arm)

    return jax.vmap(one)(jnp.asarray(cam_angles))


def roller_translating_contour(
    profile: Callable[[Any], Any],
    base_radius,
    roller_radius,
    cam_angles: Float[ArrayLike, " angles"],
    *,
    offset=0.0,
) -> CamContour:
    """The cam of a roller whose centre slides along the line x = `offset`.

    **Arguments:** a profile whose lift is a length (m), the radius of the base circle
    and of the roller (m), cam angles (rad), and the offset of the line (m).
    """
    start = jnp.sqrt((base_radius + roller_radius) ** 2 - jnp.asarray(offset) ** 2)

    def center(lift):
        return jnp.asarray(offset, dtype=float), start + lift

    def direction(lift):
        return jnp.zeros_like(lift), jnp.ones_like(lift)

    return _roller(profile, center, direction, None, roller_radius, cam_angles)


def roller_oscillating_contour(
    profile: Callable[[Any], Any],
    pivot: tuple,
    arm_length,
    roller_radius,
    cam_angles: Float[ArrayLike, " angles"],
) -> CamContour:
    """The cam of a roller on an arm that swings about a pivot.

    **Arguments:** a profile whose lift is the arm's angle (rad) from the x-axis, the
    pivot (m) from the cam's axis, the arm's length and the roller's radius (m), and cam
    angles (rad).
    """

    def center(lift):
        x = pivot[0] + arm_length * jnp.cos(lift)
        return x, pivot[1] + arm_length * jnp.sin(lift)

    def direction(lift):
        return -jnp.sin(lift), jnp.cos(lift)

    return _roller(profile, center, direction, arm_length, roller_radius, cam_angles)


def _roller(profile, center, direction, length, roller_radius, cam_angles):
    def pitch(a):
        x, y = center(profile(a))
        return jnp.stack(_turned(x, y, -a))

    def one(angle):
        unit = (jnp.ones_like(angle),)

        def rate(a):
            return jax.jvp(pitch, (a,), unit)[1]

        point = pitch(angle)
        first, second = jax.jvp(rate, (angle,), unit)
        size = jnp.hypot(first[0], first[1])
        # seen from the cam the follower goes round clockwise: left is outside
        outward = jnp.stack([-first[1], first[0]]) / size
        pitch_radius = size**3 / (first[1] * second[0] - first[0] * second[1])
        x, y = point - roller_radius * outward
        along = direction(profile(angle))
        normal = _turned(outward[0], outward[1], angle)
        cosine = normal[0] * along[0] + normal[1] * along[1]
        pressure = jnp.arccos(jnp.clip(cosine, -1.0, 1.0))
        arm = jnp.ones_like(angle) if length is None else length * cosine
        return CamContour(x, y, pitch_radius - roller_radius, pressure, arm)

    return jax.vmap(one)(jnp.asarray(cam_angles))


def _jet(profile, angle):
    """Lift, slope and curvature of any profile at one angle."""
    derivatives = getattr(profile, "derivatives", None)
    if derivatives is not None:
        return tuple(derivatives(angle)[..., k] for k in range(3))
    return profile_jet(profile, angle)


def profile_jet(profile, angle):
    """Lift, slope and curvature of a profile by differentiation."""
    unit = (jnp.ones_like(angle),)

    def slope(a):
        return jax.jvp(profile, (a,), unit)

    (lift, first), (_, second) = jax.jvp(slope, (angle,), unit)
    return lift, first, second


def _turned(x, y, angle):
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    return cosine * x - sine * y, sine * x + cosine * y
