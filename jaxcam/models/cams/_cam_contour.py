"""Compute the shape of a cam from the motion of its follower.

The cam turns counterclockwise about the origin of the fixed frame; a contour is given
in the frame of the cam, which coincides with the fixed frame at zero cam angle.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ._eccentric_circle import EccentricCircle


class CamContour(NamedTuple):
    """Contour of a cam; every field has shape `(angles,)`.

    If a radius of curvature is not positive, the contour cannot be manufactured because
    of undercutting. Choose a larger base circle or a smaller roller.
    """

    x: Float[Array, " angles"]
    """x-coordinate of the contact point in the frame of the cam (m)."""
    y: Float[Array, " angles"]
    """y-coordinate of the contact point in the frame of the cam (m)."""
    radius_of_curvature: Float[Array, " angles"]
    """Radius of curvature (m), positive where the contour is convex."""
    pressure_angle: Float[Array, " angles"]
    """Pressure angle (rad): the angle between the contact force and the direction of
    motion of the contact point.
    """
    arm: Float[Array, " angles"]
    """Lever arm of the contact force about the hinge (m); 1 for a translating
    follower.
    """


def flat_translating_contour(
    profile: Callable[[Any], Any], base_radius, cam_angles: Float[ArrayLike, " angles"]
) -> CamContour:
    """Return the cam contour for a flat-faced follower that translates along a line
    through the cam axis.

    Args:
        profile: Lift as a length (m), as a function of the cam angle (rad).
        base_radius: Distance of the face from the cam axis at zero lift (m).
        cam_angles: Cam angles (rad), shape `(angles,)`.

    Returns:
        A [`jaxcam.models.cams.CamContour`][].

    Examples:
        >>> from jaxcam.models import flat_translating_contour
        >>> lift = lambda angle: 0.002 * (1 - jnp.cos(angle))
        >>> flat_translating_contour(lift, 0.02, jnp.linspace(0, 6, 5)).x.shape
        (5,)
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
    """Return the cam contour for a flat-faced follower hinged at the origin.

    The common normal intersects the line from the hinge to the cam axis at the point
    where both bodies have the same velocity, so the contact point follows from the
    angle of the follower and its derivative.

    Args:
        profile: Angle of the follower (rad) as a function of the cam angle (rad).
        cam_angles: Cam angles (rad), shape `(angles,)`.
        center: Position (x0, y0) of the cam axis relative to the hinge (m); not
            required for an [`jaxcam.models.EccentricCircle`][], which defines it.
        half_height: Distance of the face from the hinge (m); like `center`, not
            required for an `EccentricCircle`.

    Returns:
        The contour about the cam axis.

    Raises:
        ValueError: The cam axis or the half height is unknown.

    Examples:
        >>> from jaxcam.models import EccentricCircle, flat_oscillating_contour
        >>> contour = flat_oscillating_contour(EccentricCircle(), jnp.linspace(0, 6, 5))
        >>> np.asarray(contour.radius_of_curvature).round(6).tolist()
        [0.045, 0.045, 0.045, 0.045, 0.045]
    """
    if isinstance(profile, EccentricCircle):
        if center is None:
            center = (profile.center_x, profile.center_y)
        if half_height is None:
            half_height = profile.half_height
    if center is None or half_height is None:
        raise ValueError(
            "Give `center` and `half_height`: this profile does not define the cam "
            "axis and the follower face."
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
        # in the frame of the cam, the face rotates at the rate slope - 1, and the
        # contact point moves along the face in the sense opposite to this rotation
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
    """Return the cam contour for a roller whose centre slides along the line x =
    `offset`.

    Args:
        profile: Lift as a length (m), as a function of the cam angle (rad).
        base_radius: Radius of the base circle (m).
        roller_radius: Radius of the roller (m).
        cam_angles: Cam angles (rad), shape `(angles,)`.
        offset: Offset of the line (m).

    Returns:
        A [`jaxcam.models.cams.CamContour`][].

    Examples:
        >>> from jaxcam.models import roller_translating_contour
        >>> lift = lambda angle: 0.002 * (1 - jnp.cos(angle))
        >>> roller_translating_contour(lift, 0.02, 0.005, jnp.linspace(0, 6, 5)).y.shape
        (5,)
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
    """Return the cam contour for a roller on an arm that swings about a pivot.

    Args:
        profile: Angle of the arm (rad) from the x-axis, as a function of the cam angle
            (rad).
        pivot: Position of the pivot relative to the cam axis (m).
        arm_length: Length of the arm (m).
        roller_radius: Radius of the roller (m).
        cam_angles: Cam angles (rad), shape `(angles,)`.

    Returns:
        A [`jaxcam.models.cams.CamContour`][].

    Examples:
        >>> from jaxcam.models import roller_oscillating_contour
        >>> swing = lambda angle: 2.7 + 0.05 * jnp.cos(angle)
        >>> angles = jnp.linspace(0, 6, 5)
        >>> roller_oscillating_contour(swing, (0.06, 0.0), 0.05, 0.005, angles).x.shape
        (5,)
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
        # in the frame of the cam, the follower moves clockwise, so its left side is the
        # outside
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
    """Return the lift of any profile and its first two derivatives at one angle."""
    derivatives = getattr(profile, "derivatives", None)
    if derivatives is not None:
        return tuple(derivatives(angle)[..., k] for k in range(3))
    return profile_jet(profile, angle)


def profile_jet(profile, angle):
    """Return the lift of a profile and its first two derivatives by differentiation."""
    unit = (jnp.ones_like(angle),)

    def slope(a):
        return jax.jvp(profile, (a,), unit)

    (lift, first), (_, second) = jax.jvp(slope, (angle,), unit)
    return lift, first, second


def _turned(x, y, angle):
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    return cosine * x - sine * y, sine * x + cosine * y
