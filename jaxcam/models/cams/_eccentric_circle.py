"""The cam of the thesis: a circular disc that turns about an eccentric point."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...hybrid.programs import program
from .._parameters import is_concrete, parameter, require_finite, require_positive
from ._fourier_profile import FourierProfile
from ._profile import CamProfile


_TAIL = 1e-13
"""Largest part of the profile (rad) that the Fourier series may omit."""


class EccentricCircle(CamProfile):
    """Profile of an eccentric circular cam with a flat follower hinged at the origin.

    The contact angle is given in the thesis, eq. 4.23; the defaults are those of its
    Table 4.4.

    Examples:
        >>> from jaxcam.models import EccentricCircle
        >>> EccentricCircle().prepared().cosines.shape
        (12,)
    """

    radius: jax.Array = parameter(0.045)
    """Radius of the cam, R (m)."""
    eccentricity: jax.Array = parameter(0.015)
    """Distance of the centre of the disc from the cam axis, e (m)."""
    center_x: jax.Array = parameter(0.249)
    """x-coordinate of the cam axis relative to the follower hinge, x0 (m)."""
    center_y: jax.Array = parameter(0.0)
    """y-coordinate of the cam axis relative to the follower hinge, y0 (m)."""
    half_height: jax.Array = parameter(0.021)
    """Distance of the flat face of the follower from its hinge, d (m)."""
    harmonics: int = eqx.field(default=12, static=True)
    """Number of harmonics kept by `prepared`."""

    def __check_init__(self):
        if self.harmonics < 1:
            raise ValueError(
                f"Keep at least one harmonic; `harmonics` is {self.harmonics}."
            )

    def __call__(self, cam_angle) -> jax.Array:
        x = self.eccentricity * jnp.cos(cam_angle) + self.center_x
        y = self.eccentricity * jnp.sin(cam_angle) + self.center_y
        height = self.radius + self.half_height
        return jnp.arcsin(height / jnp.sqrt(x * x + y * y)) + jnp.arctan2(y, x)

    def prepared(self) -> FourierProfile:
        """Return the same profile as a Fourier series, differentiable in the geometry.

        The coefficients are computed by an FFT of the contact angle (thesis, eq. 4.23)
        over one turn.

        Returns:
            A [`jaxcam.models.FourierProfile`][].

        Raises:
            ValueError: The omitted harmonics add up to more than 1e-13 rad. Inside
                `jax.jit`, the values are unknown and no error is raised; call `check`
                first.
        """
        mean, cosines, sines, left_out = _series(self)
        if is_concrete(left_out) and not left_out <= _TAIL:
            raise ValueError(
                f"Increase `harmonics` of the cam profile: with {self.harmonics}, "
                "up to "
                f"{left_out:.1e} rad of it are omitted."
            )
        return FourierProfile(mean, cosines, sines)

    def check(self) -> None:
        """Raise `ValueError` for an impossible geometry or too few harmonics."""
        require_positive(radius=self.radius, half_height=self.half_height)
        require_finite(
            eccentricity=self.eccentricity,
            center_x=self.center_x,
            center_y=self.center_y,
        )
        offset = np.abs(self.eccentricity)
        if not np.all(np.asarray(self.center_x) > offset):
            raise ValueError(
                "Place the cam axis to the right of the follower hinge: `center_x` "
                "must exceed `eccentricity`."
            )
        nearest = np.hypot(self.center_x, self.center_y) - offset
        if not np.all(nearest > np.asarray(self.radius + self.half_height)):
            raise ValueError(
                "Move the cam away from the follower hinge, or make it smaller: the "
                "distance of its centre from the hinge must exceed `radius + "
                "half_height` at every cam angle."
            )
        self.prepared()


@program
def _series(circle: EccentricCircle):
    """Return the mean, the cosine and sine coefficients to keep, and the sum of the
    amplitudes of the omitted harmonics (rad).
    """
    keep = circle.harmonics
    # use four samples per kept harmonic, so that the aliasing error is far smaller than
    # the first omitted harmonic
    points = max(64, 4 * keep)
    angles = 2 * np.pi * np.arange(points) / points
    spectrum = jnp.fft.rfft(circle(jnp.asarray(angles, dtype=float))) / points
    harmonics = spectrum[1 : points // 2]
    cosines, sines = 2 * harmonics.real, -2 * harmonics.imag
    left_out = jnp.sum(jnp.hypot(cosines[keep:], sines[keep:]))
    return spectrum[0].real, cosines[:keep], sines[:keep], left_out
