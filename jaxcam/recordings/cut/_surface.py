"""The surface of the actual cam: the nominal profile, corrected by recordings.

The contact angle of an actual cam differs from that of the nominal cam by up to tens of
times the noise of an encoder, even if the cam is within its tolerances. With the
nominal contact angle, contact could not be distinguished from a low flight.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...hybrid.programs import program
from ...models import EccentricCircle
from .._rig import Rig
from ._bend import WAVES, waves
from ._padding import padded


# Orders and size (rad) of the harmonic deviations of a cam from its geometry, which are
# due to run-out, bearings or a bent shaft
_HARMONICS = (2, 3)
_HARMONIC_SIZE = 2e-4
# Indices at which the sines and the bend begin among the amplitudes
_ENDS = (len(_HARMONICS), 2 * len(_HARMONICS))
# Size of the zero error of the cam angle (rad), including a sensor lag of half a
# millisecond
_PHASE_SIZE = 1e-2
# Minimum tolerance of a length (m), also used if a rig file states none
_LEAST_TOLERANCE = 2e-4


class Surface(eqx.Module):
    """Contact angle (rad) as a function of the cam angle, from geometry and
    harmonics.
    """

    profile: EccentricCircle
    """The eccentric circle that fits best."""
    phase: Float[Array, ""]
    """Phase by which the cam leads its measured angle (rad)."""
    cosines: Float[Array, " harmonics"]
    """Cosine amplitudes of the additional harmonics 2 and 3 (rad)."""
    sines: Float[Array, " harmonics"]
    """Sine amplitudes of the additional harmonics 2 and 3 (rad)."""
    bend: Float[Array, " waves"]
    """Amplitudes of a local deviation, such as a dent, that the harmonics cannot
    describe; zero if there is none.
    """
    covariance: Float[Array, " p p"]
    """Covariance of radius, eccentricity, centre, phase and amplitudes."""
    sense: float = eqx.field(static=True)
    """-1 for a clockwise cam, otherwise 1; the cam angle increases in the sense of
    rotation.
    """

    def __call__(self, turned: Float[Array, "*k"]) -> Float[Array, "*k"]:
        order = jnp.asarray(_HARMONICS, dtype=float)
        angle = self.sense * (jnp.asarray(turned) + self.phase)
        phases = jnp.multiply.outer(angle, order)
        extra = jnp.cos(phases) @ self.cosines + jnp.sin(phases) @ self.sines
        return self.profile(angle) + extra + waves(turned) @ self.bend

    def angle(self, turned) -> Float[np.ndarray, " k"]:
        """Return the contact angle (rad) as a NumPy array, shape `(k,)`."""
        turned = np.asarray(turned)
        return np.asarray(_evaluate(self, padded(turned))[0])[: len(turned)]

    def slope(self, turned) -> Float[np.ndarray, " k"]:
        """Return the derivative of the contact angle with respect to the cam angle."""
        turned = np.asarray(turned)
        return np.asarray(_evaluate(self, padded(turned))[1])[: len(turned)]

    def slope_stderr(self, turned) -> Float[np.ndarray, " k"]:
        """Return the standard error of `slope`; it is large where no impact or contact
        was observed.
        """
        turned = np.asarray(turned)
        rows = np.asarray(_slope_jacobian(self, vector_of(self), padded(turned)))
        rows = rows[: len(turned)]
        return np.sqrt(np.einsum("...i,ij,...j", rows, self.covariance, rows))


def nominal_surface(rig: Rig) -> Surface:
    """Return the nominal profile of the rig file.

    Args:
        rig: The rig.

    Returns:
        A [`jaxcam.recordings.cut.Surface`][].

    Examples:
        >>> from jaxcam.data import DEMO_RIG
        >>> from jaxcam.recordings import read_rig
        >>> from jaxcam.recordings.cut import nominal_surface
        >>> surface = nominal_surface(read_rig(DEMO_RIG / "rig.toml"))
        >>> surface.angle([0.0, np.pi]).round(4).tolist()  # rad, at two cam angles
        [0.2527, 0.2859]
    """
    zero = jnp.zeros(len(_HARMONICS))
    sense = -1.0 if rig.cam_rotation == "clockwise" else 1.0
    bend = np.zeros(WAVES)
    sizes = np.concatenate([prior_sizes(rig), bend])
    covariance = jnp.diag(jnp.asarray(sizes) ** 2)
    return Surface(
        rig.profile(), jnp.zeros(()), zero, zero, jnp.asarray(bend), covariance, sense
    )


def prior_sizes(rig: Rig) -> np.ndarray:
    """Return the tolerance of each coefficient of a surface without its bend, shape
    `(q,)`.
    """
    geometry = [
        np.hypot(rig.cam_radius.tolerance, rig.follower_half_height.tolerance),
        rig.cam_eccentricity.tolerance,
        rig.cam_center_x.tolerance,
        rig.cam_center_y.tolerance,
    ]
    harmonics = np.full(2 * len(_HARMONICS), _HARMONIC_SIZE)
    geometry = np.maximum(geometry, _LEAST_TOLERANCE)
    return np.concatenate([geometry, [_PHASE_SIZE], harmonics])


def vector_of(surface: Surface) -> np.ndarray:
    """Return the fitted coefficients of a surface, shape `(p,)`."""
    p = surface.profile
    geometry = [p.radius + p.half_height, p.eccentricity, p.center_x, p.center_y]
    low = np.array([*geometry, surface.phase])
    return np.concatenate([low, surface.cosines, surface.sines, surface.bend])


def with_vector(surface: Surface, vector) -> Surface:
    """Return the same surface with other coefficients."""
    # only the sum of radius and half height is identifiable; it is assigned to the
    # radius
    radius = vector[0] - surface.profile.half_height
    cosines, sines, bend = jnp.split(vector[5:], _ENDS)
    return eqx.tree_at(
        lambda s: (
            s.profile.radius,
            s.profile.eccentricity,
            s.profile.center_x,
            s.profile.center_y,
            s.phase,
            s.cosines,
            s.sines,
            s.bend,
        ),
        surface,
        (radius, vector[1], vector[2], vector[3], vector[4], cosines, sines, bend),
    )


@program
def linearise(surface, vector, turned):
    """Return contact angles `(k,)` and their derivatives `(k, p)` with respect to the
    coefficients.
    """
    low, bend = vector[:-WAVES], vector[-WAVES:]

    def contact_angle(low):
        return with_vector(surface, jnp.concatenate([low, bend]))(turned)

    jacobian = jax.jacfwd(contact_angle)(low)
    return contact_angle(low), jnp.concatenate([jacobian, waves(turned)], axis=-1)


@program
def _evaluate(surface, turned):
    turned = jnp.asarray(turned)
    return jax.jvp(surface, (turned,), (jnp.ones_like(turned),))


@program
def _slope_jacobian(surface, vector, turned):
    turned = jnp.asarray(turned)

    def slope(vector):
        profile = with_vector(surface, vector)
        return jax.jvp(profile, (turned,), (jnp.ones_like(turned),))[1]

    return jax.jacfwd(slope)(vector)
