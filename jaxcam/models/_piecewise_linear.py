"""Two linear systems joined along a line, and when their origin is stable."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..filippov import FilippovSystem
from ._parameters import parameter, require_finite


_JOINED = 1e-9


class PiecewiseLinear(FilippovSystem):
    """`x' = A- x` where c x <= 0 and `x' = A+ x` where c x >= 0 (thesis, eq. 2.44).

    Where the field is continuous, A+ - A- = k c for some vector k, there is no sliding;
    in general there is.

    **Arguments:** matrices of shape `(n, n)` and the vector c, shape `(n,)`.
    """

    minus: jax.Array = parameter()
    plus: jax.Array = parameter()
    normal: jax.Array = parameter()

    def above(self, t, state) -> jax.Array:
        """A+ x."""
        del t
        return self.plus @ state

    def below(self, t, state) -> jax.Array:
        """A- x."""
        del t
        return self.minus @ state

    def switching(self, t, state) -> jax.Array:
        """c x."""
        del t
        return jnp.sum(self.normal * state)

    def check(self) -> None:
        """Raise `ValueError` for a matrix or vector that is not finite."""
        require_finite(minus=self.minus, plus=self.plus, normal=self.normal)


class PlanarStability(NamedTuple):
    """What Theorem 2.2 says of the origin."""

    stable: bool
    """Asymptotically stable."""
    periodic: bool
    """Every motion is periodic, with this period (s); NaN where they are not."""
    period: float
    growth: float
    """Growth of the logarithm of the amplitude in one turn; NaN where nothing turns."""


def planar_stability(system: PiecewiseLinear) -> PlanarStability:
    """Stability of the origin of a planar continuous system, by Theorem 2.2.

    Raises:
        ValueError: For another number of states, a field that jumps at the line, or a
            pair (c, A-) that is not observable.
    """
    minus, plus = np.asarray(system.minus), np.asarray(system.plus)
    c = np.asarray(system.normal)
    if minus.shape != (2, 2) or plus.shape != (2, 2) or c.shape != (2,):
        raise ValueError("Theorem 2.2 is about two states; give 2 by 2 matrices.")
    tangent = np.array([-c[1], c[0]])
    scale = np.linalg.norm(c) * max(np.linalg.norm(minus), np.linalg.norm(plus))
    if np.linalg.norm((plus - minus) @ tangent) > _JOINED * scale:
        raise ValueError(
            "Join the two fields continuously: A+ - A- must be a column times c."
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
