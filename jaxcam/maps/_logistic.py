"""The logistic map."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


class LogisticMap(eqx.Module):
    """Logistic map x -> mu x (1 - x) on [0, 1], 0 < mu <= 4 (thesis, eq. 2.8).

    Examples:
        >>> from jaxcam.maps import LogisticMap
        >>> float(LogisticMap(2.0)(0.25))
        0.375
    """

    mu: jax.Array = eqx.field(
        default=3.3, converter=lambda value: jnp.asarray(value, dtype=float)
    )
    """Parameter mu."""

    def __call__(self, x) -> jax.Array:
        return self.mu * x * (1 - x)

    def fixed_point(self) -> jax.Array:
        """Return the nonzero fixed point, which is stable for 1 < mu < 3."""
        return (self.mu - 1) / self.mu

    def period_two(self) -> Float[Array, " 2"]:
        """Return the two points of the period-two orbit, `(2,)`; NaN for mu < 3
        (thesis, section 2.2.2).
        """
        mu = self.mu
        root = jnp.sqrt(mu * mu - 2 * mu - 3)
        return jnp.stack([1 + mu - root, 1 + mu + root]) / (2 * mu)
