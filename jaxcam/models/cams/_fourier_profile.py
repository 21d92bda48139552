"""A cam profile given by its Fourier coefficients."""

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero

from ...hybrid.lowering import saving_jvp
from .._parameters import parameter, require_finite
from ._profile import CamProfile


class FourierProfile(CamProfile):
    """A profile `mean + sum_k cosines[k-1] cos(k a) + sines[k-1] sin(k a)`.

    It is infinitely smooth and the cheapest profile to evaluate: one sine and one
    cosine for any number of harmonics.

    Raises:
        ValueError: The two lists are empty or differ in length.

    Examples:
        >>> from jaxcam.models import FourierProfile
        >>> profile = FourierProfile(0.1, [0.02], [0.0])
        >>> round(float(profile(0.0)), 6)
        0.12
    """

    mean: jax.Array = parameter()
    """Mean contact angle over a turn (rad)."""
    cosines: jax.Array = parameter()
    """Cosine coefficients of harmonics 1, 2, ... (rad), shape `(harmonics,)`."""
    sines: jax.Array = parameter()
    """Sine coefficients of harmonics 1, 2, ... (rad), shape `(harmonics,)`."""

    def __check_init__(self):
        if self.cosines.shape != self.sines.shape or self.cosines.size == 0:
            raise ValueError(
                "Give as many sines as cosines, one of each for at least one harmonic; "
                f"their shapes are {self.sines.shape} and {self.cosines.shape}."
            )

    def __call__(self, cam_angle) -> jax.Array:
        return _series(cam_angle, self.mean, self.cosines, self.sines)

    def check(self) -> None:
        require_finite(mean=self.mean, cosines=self.cosines, sines=self.sines)


def _sum(angle, mean, cosines, sines):
    # The waves follow from a recurrence, which is unrolled in Python so that it fuses
    # into plain arithmetic inside the loop of a simulation. The derivatives of a gap
    # use the same waves.
    cosine, sine = jnp.cos(angle), jnp.sin(angle)
    twice = 2 * cosine
    # the mean is added last: it is the largest term, so adding the others to it one by
    # one would round each of them
    total = cosines[0] * cosine + sines[0] * sine
    before, now = (jnp.ones_like(cosine), jnp.zeros_like(sine)), (cosine, sine)
    for k in range(1, cosines.shape[-1]):
        after = tuple(twice * b - a for a, b in zip(before, now, strict=True))
        before, now = now, after
        total = total + cosines[k] * now[0] + sines[k] * now[1]
    return mean + total


# The derivative of a series is also a series. A custom rule halves the total cost of
# gap, velocity, acceleration and jerk compared with differentiating the recurrence. The
# rule is traced only once for each number of harmonics, because a simulation uses it
# many times.
_series = saving_jvp(_sum)


def _series_jvp(primals, tangents):
    angle, mean, cosines, sines = primals
    angle_dot, *coefficients_dot = tangents
    value = _series(angle, mean, cosines, sines)
    tangent = jnp.zeros_like(value)
    if not _is_zero(angle_dot):
        order = np.arange(1, cosines.shape[-1] + 1, dtype=cosines.dtype)
        slope = _series(angle, jnp.zeros_like(mean), order * sines, -order * cosines)
        tangent = tangent + slope * angle_dot
    if not all(map(_is_zero, coefficients_dot)):
        given = [
            jnp.zeros(dot.shape, dot.dtype) if _is_zero(dot) else dot
            for dot in coefficients_dot
        ]
        tangent = tangent + _series(angle, *given)
    return value, tangent


def _is_zero(tangent) -> bool:
    return isinstance(tangent, SymbolicZero)


_series.defjvp(_series_jvp, symbolic_zeros=True)
