"""Two linear systems joined along a line, and the stability of their origin."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..filippov import FilippovSystem
from ._parameters import parameter, require_finite


_JOINED = 1e-9


class PiecewiseLinear(FilippovSystem):
    """Piecewise-linear system: `x' = A- x` for c x <= 0 and `x' = A+ x` for c x >= 0.

    If the field is continuous, that is, A+ - A- = k c for some vector k, there is no
    sliding; otherwise there generally is (thesis, eq. 2.44).

    Examples:
        >>> from jaxcam.models import PiecewiseLinear
        >>> system = PiecewiseLinear(-np.eye(2), -2 * np.eye(2), np.array([1.0, 0.0]))
        >>> system.above(0.0, jnp.array([1.0, 0.0])).tolist()
        [-2.0, 0.0]
    """

    minus: jax.Array = parameter()
    """The matrix A-, shape `(n, n)`."""
    plus: jax.Array = parameter()
    """The matrix A+, shape `(n, n)`."""
    normal: jax.Array = parameter()
    """The vector c, shape `(n,)`."""

    def above(self, t, state) -> jax.Array:
        """Return A+ x."""
        del t
        return self.plus @ state

    def below(self, t, state) -> jax.Array:
        """Return A- x."""
        del t
        return self.minus @ state

    def switching(self, t, state) -> jax.Array:
        """Return c x."""
        del t
        return jnp.sum(self.normal * state)

    def check(self) -> None:
        """Raise `ValueError` for a matrix or vector that is not finite."""
        require_finite(minus=self.minus, plus=self.plus, normal=self.normal)


class PlanarStability(NamedTuple):
    """Stability of the origin (thesis, Theorem 2.2)."""

    stable: bool
    """Whether the origin is asymptotically stable."""
    periodic: bool
    """Whether every motion is periodic."""
    period: float
    """Period of the motions (s); NaN if they are not periodic."""
    growth: float
    """Growth of the logarithm of the amplitude in one turn around the origin; NaN if
    there is no rotation.
    """


def planar_stability(system: PiecewiseLinear) -> PlanarStability:
    """Return the stability of the origin of a planar system with a continuous field
    (thesis, Theorem 2.2).

    Args:
        system: The system.

    Returns:
        A `PlanarStability`.

    Raises:
        ValueError: The system does not have two states, its field jumps at the line, or
            the pair (c, A-) is not observable.

    Examples:
        >>> from jaxcam.models import PiecewiseLinear, planar_stability
        >>> minus = np.array([[-0.2, 1.0], [-1.0, 0.0]])
        >>> plus = np.array([[-0.2, 1.0], [-4.0, 0.0]])
        >>> system = PiecewiseLinear(minus, plus, np.array([1.0, 0.0]))
        >>> bool(planar_stability(system).stable)
        True
    """
    minus, plus = np.asarray(system.minus), np.asarray(system.plus)
    c = np.asarray(system.normal)
    if minus.shape != (2, 2) or plus.shape != (2, 2) or c.shape != (2,):
        raise ValueError("Theorem 2.2 is for two states; give 2 by 2 matrices.")
    tangent = np.array([-c[1], c[0]])
    scale = np.linalg.norm(c) * max(np.linalg.norm(minus), np.linalg.norm(plus))
    if np.linalg.norm((plus - minus) @ tangent) > _JOINED * scale:
        raise ValueError(
            "The field must be continuous: A+ - A- must be a column times c."
        )
    if abs(np.linalg.det(np.stack([c, c @ minus]))) <= 1e-12 * scale * np.linalg.norm(
        c
    ):
        raise ValueError("The pair (c, A-) is not observable; choose another line.")
    values = [np.linalg.eigvals(matrix) for matrix in (minus, plus)]
    turns = [bool(np.any(np.imag(v) != 0)) for v in values]
    grows = any(
        np.any(np.real(v) >= 0)
        for v, turn in zip(values, turns, strict=True)
        if not turn
    )
    if not all(turns):
        return PlanarStability(not grows, False, float("nan"), float("nan"))
    rates = [(v[0].real, abs(v[0].imag)) for v in values]
    growth = float(np.pi * sum(sigma / omega for sigma, omega in rates))
    periodic = growth == 0
    period = float(np.pi * sum(1 / omega for _, omega in rates))
    return PlanarStability(
        growth < 0, periodic, period if periodic else float("nan"), growth
    )
