"""Compute the scales of the lobes at the interruption of complete chatter."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float


class ScalingLaw(eqx.Module):
    """Fixed point of the lambda-map, and the scales that follow from it.

    f is [`variational.lambda_map`][], h is [`variational.chatter.hop_ratio`][], and
    beta is [`variational.beta_map`][].
    """

    lambda_bar: Float[Array, "..."]
    """Fixed point: impacts with this lambda accumulate exactly at release (thesis,
    eq. 6.45)."""
    p: Float[Array, "..."]
    """h(lambda_bar), the ratio (less than 1) of the times from successive impacts to
    release.
    """
    q: Float[Array, "..."]
    """1 / f'(lambda_bar), the ratio (less than 1) of the distances of successive lobes
    from lambda_bar (thesis, eq. 6.49).
    """
    kappa: Float[Array, "..."]
    """Exponent of the envelope |beta| <= |lambda - lambda_bar|^kappa (thesis,
    eq. 6.53)."""


def scaling_law(r) -> ScalingLaw:
    """Return the scales p and q and the exponent kappa at the interruption of chatter.

    With s = sqrt(1 - 8 lambda / 3), the fixed point of the map in the thesis, eq. 6.36,
    is a root of 9 s^3 + 3 s^2 - (5 + 8 r) s + 1 in (1/3, 1). The other positive root
    has p < 0: it corresponds to an impact after release, so it is not a fixed point of
    an actual motion. With the first root, p = (3 s - 1)/2, 1/q = (1 + s)^2/(4 s^2 p)
    and kappa = 2 ln p/ln q.

    Args:
        r: Coefficient of restitution of slow impacts, any shape.

    Returns:
        A [`variational.chatter.ScalingLaw`][], dimensionless, in the shape of `r`.

    Raises:
        ValueError: r is outside (0, 1) (checked only outside transformations).

    Examples:
        >>> from variational import scaling_law
        >>> law = scaling_law(0.5)
        >>> bool((0 < law.q) & (law.q < law.p) & (law.p < 1))
        True
    """
    if not isinstance(r, Tracer):
        values = np.asarray(r)
        if not np.all((values > 0) & (values < 1)):
            raise ValueError(
                f"r is {r}; give a coefficient of restitution strictly between 0 and "
                "1, because impacts do not accumulate without rebound or without loss"
            )
    r = jnp.asarray(r, dtype=jnp.float64)

    def newton(_, s):
        value = ((9 * s + 3) * s - (5 + 8 * r)) * s + 1
        slope = (27 * s + 6) * s - (5 + 8 * r)
        return s - value / slope

    # the cubic is convex for s > 0, so Newton's method from s = 1 converges to the
    # largest root
    s = jax.lax.fori_loop(0, 64, newton, jnp.ones_like(r))
    p = (3 * s - 1) / 2
    q = 4 * s * s * p / ((1 + s) * (1 + s))
    return ScalingLaw(
        lambda_bar=3 * (1 - s) * (1 + s) / 8,
        p=p,
        q=q,
        kappa=2 * jnp.log(p) / jnp.log(q),
    )
