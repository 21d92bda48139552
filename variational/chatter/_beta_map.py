"""Compute beta(lambda), the deviation from the sticking orbit after interrupted
chatter.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jaxcam.hybrid.lowering import while_loop

from ._lambda_map import hop_ratio, lambda_map, LAMBDA_MAX
from ._scaling_law import scaling_law


# maximum number of impacts; lambda - lambda_bar grows by the factor 1/q at each of them
# (thesis, eq. 6.49)
_IMPACTS = 4000


class BetaMap(eqx.Module):
    """The deviation from the sticking orbit after the last impact of chatter.

    An impact at time tau < 0 relative to release, with rebound speed v, has the
    coordinate lambda = v / (c tau^2), where c is the rate of the relative acceleration
    at release (thesis, eqs. 6.28 and 6.84); the next impact is at time h(lambda) tau
    (eq. 6.33). Let tau* be the time of the first impact relative to release. At the
    section time tau_P after release (eqs. 6.54 and 6.94), the motion after the last
    impact has

        velocity = c (tau_P^2 / 2 + beta tau*^2),
        gap = c (tau_P^3 / 6 + beta tau*^2 tau_P + gamma tau*^3).

    After complete chatter, the motion starts from contact at release, and both beta and
    gamma are zero.
    """

    beta: Float[Array, "..."]
    """P^2 (lambda - 1/2) at the last impact, where P is the product of h(lambda) over
    the impacts before it (thesis, eqs. 6.33 and 6.43).
    """
    gamma: Float[Array, "..."]
    """P^3 (1/3 - lambda) at the last impact, the term omitted in the thesis, eq.
    6.55.
    """
    impacts: Int[Array, "..."]
    """Number of impacts after the first."""


def beta_parts(lam, r) -> BetaMap:
    """Iterate the lambda-map to the last impact (thesis, eqs. 6.43, 6.44 and 6.97).

    Args:
        lam: Coordinate lambda of the first impact, dimensionless, >= 0, any shape.
        r: Coefficient of restitution in (0, 1), broadcast against `lam`.

    Returns:
        A [`variational.chatter.BetaMap`][]. It is zero up to lambda_bar, the fixed
            point of the lambda-map (thesis, eq. 6.45), where chatter is completed
            before release (`impacts` is then 0).

    Examples:
        >>> from variational.chatter import beta_parts
        >>> parts = beta_parts(0.4, r=0.5)  # no impact follows
        >>> round(float(parts.beta), 6), round(float(parts.gamma), 6)  # -0.1 and -1/15
        (-0.1, -0.066667)
    """
    lam, r = jnp.broadcast_arrays(
        jnp.asarray(lam, jnp.float64), jnp.asarray(r, jnp.float64)
    )
    bar = scaling_law(r).lambda_bar
    one = _one
    for _ in range(lam.ndim):
        one = jax.vmap(one)
    return BetaMap(*one(lam, r, bar))


def beta_map(lam, r) -> Float[Array, "..."]:
    """Return beta(lambda): the deviation from the sticking orbit after interrupted
    chatter.

    Args:
        lam: Coordinate lambda of the first impact, dimensionless, >= 0, any shape.
        r: Coefficient of restitution in (0, 1), broadcast against `lam`.

    Returns:
        Beta, dimensionless (thesis, eq. 6.97): 0 up to the fixed point lambda_bar of
            the lambda-map, then lobes between square-root corners, each wider than the
            previous one by the factor 1/q and higher by the factor 1/p^2, with the
            scales p and q of [`variational.scaling_law`][] (thesis, eq. 6.49).

    Examples:
        >>> from variational import beta_map
        >>> float(beta_map(0.01, 0.5))
        0.0
    """
    return beta_parts(lam, r).beta


def _one(lam, r, bar):
    def goes_on(carry):
        lam, _, count = carry
        return (lam > bar) & (lam < 1 / 3) & (count < _IMPACTS)

    def hop(carry):
        lam, scale, count = carry
        return lambda_map(lam, r), scale * hop_ratio(lam), count + 1

    start = (lam, jnp.ones_like(lam), jnp.asarray(0))
    lam, scale, count = while_loop(goes_on, hop, start)
    # for lambda between 1/3 and 3/8, one more impact follows after release
    after = (lam >= 1 / 3) & (lam <= LAMBDA_MAX)
    safe = jnp.where(after, lam, 0.35)
    end = jnp.where(after, lambda_map(safe, r), lam)
    scale = scale * jnp.where(after, hop_ratio(safe), 1.0)
    # a flight that ends exactly at release has lambda = inf and scale = 0
    speed = jnp.where(jnp.isinf(end), 0.0, scale * scale * end)
    beta = speed - scale * scale / 2
    gamma = scale * (scale * scale / 3 - speed)
    gone = lam > bar
    return (
        jnp.where(gone, beta, 0.0),
        jnp.where(gone, gamma, 0.0),
        jnp.where(gone, count + after.astype(count.dtype), 0),
    )
