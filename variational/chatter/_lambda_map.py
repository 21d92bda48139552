"""Compute the map of low-velocity impacts close to release in the coordinate lambda.

Close to the release point of sticking, the relative acceleration is c tau, with tau the
time relative to release and c the jerk at release. An impact at tau < 0 with rebound
speed v has lambda = v / (c tau^2); the next impact is at the time h(lambda) tau and has
the coordinate f(lambda) (thesis, eqs. 6.28-6.37).
"""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid.lowering import while_loop


LAMBDA_MAX = 3 / 8
"""Largest lambda for which the motion returns (thesis, eq. 6.47); above 1/3, it returns
after release.
"""


def _root(lam):
    """Return s = sqrt(1 - 8 lambda / 3); NaN if no impact follows (thesis, eq.
    6.32).
    """
    return jnp.sqrt(1 - 8 * lam / 3)


def hop_ratio(lam) -> Float[Array, "..."]:
    """Return h(lambda), the ratio of the times, relative to release, of the next impact
    and this one; [`variational.lambda_map`][] defines lambda.

    Args:
        lam: Coordinate lambda, dimensionless, any shape, between 0 and 3/8.

    Returns:
        h, between 1 and -1/2 (thesis, eq. 6.33); negative if the next impact is after
            release; NaN above 3/8, where there is no next impact.

    Examples:
        >>> from variational.chatter import hop_ratio
        >>> np.asarray(hop_ratio(jnp.array([0.0, 1 / 3, 3 / 8]))).round(6).tolist()
        [1.0, 0.0, -0.5]
    """
    return (3 * _root(lam) - 1) / 2


def lambda_map(lam, r) -> Float[Array, "..."]:
    """Return f(lambda), the coordinate of the next impact (thesis, eqs. 6.36 and 6.89).

    An impact at time tau relative to release, with rebound speed v, has the coordinate
    lambda = v / (c tau^2), where c is the jerk at release.

    Args:
        lam: Coordinate lambda, dimensionless, any shape, between 0 and 3/8.
        r: Coefficient of restitution of slow impacts, broadcast against `lam`.

    Returns:
        f, with a pole at 1/3, where the next impact is exactly at release; NaN above
            3/8, where the motion does not return to the surface.

    Examples:
        >>> from variational import lambda_map, scaling_law
        >>> fixed = scaling_law(0.5).lambda_bar
        >>> abs(float(lambda_map(fixed, 0.5) - fixed)) < 1e-12
        True
    """
    s = _root(lam)
    # 3 s (1 - s) = 8 lambda s / (1 + s) retains all digits of a small lambda
    return 8 * r * lam * s / ((1 + s) * (3 * s - 1) ** 2)


def lambda_inverse(lam, r) -> Float[Array, "..."]:
    """Return the coordinate of the previous impact: f(lambda_inverse(lam, r)) = lam.

    The map f is [`variational.lambda_map`][], which also defines lambda.

    Args:
        lam: Coordinate lambda, dimensionless, >= 0.
        r: Coefficient of restitution.

    Returns:
        Lambda in [0, 1/3), in the broadcast shape.

    Examples:
        >>> from variational import lambda_inverse, lambda_map
        >>> round(float(lambda_map(lambda_inverse(0.2, 0.5), 0.5)), 9)
        0.2
    """
    lam = jnp.asarray(lam)
    root = jnp.sqrt(9 * r * r + 24 * r * lam)
    s = (6 * lam + 3 * r + root) / (18 * lam + 6 * r)
    # 1 - s without cancellation
    return 3 * lam * (1 + s) / (12 * lam + 3 * r + root)


def koenigs(lam, lambda_bar, r, q) -> Float[Array, ""]:
    """Return the coordinate in which the lambda-map is a multiplication.

    This coordinate, K, satisfies K(f(lambda)) = K(lambda)/q, where f is
    [`variational.lambda_map`][], and is the limit of (f^-n(lambda) - lambda_bar) q^-n.
    K is zero at lambda_bar, with slope one; it is negative if chatter is completed
    before release, and positive otherwise (G. Koenigs' linearisation of a map at a
    fixed point).

    Args:
        lam: Coordinate lambda, a dimensionless scalar >= 0.
        lambda_bar: Fixed point, as in [`variational.scaling_law`][].
        r: Coefficient of restitution of slow impacts.
        q: Scale, as in [`variational.scaling_law`][].

    Returns:
        A scalar.

    Examples:
        >>> from variational import koenigs, scaling_law
        >>> law = scaling_law(0.5)
        >>> abs(float(koenigs(law.lambda_bar, law.lambda_bar, 0.5, law.q))) < 1e-12
        True
    """
    bar_root = jnp.sqrt(9 * r * r + 24 * r * lambda_bar)
    bar_top = 6 * lambda_bar + 3 * r + bar_root
    bar_bottom = 18 * lambda_bar + 6 * r
    bar_s = bar_top / bar_bottom

    def back(carry):
        deviation, scaled, count = carry
        # f^-1(lambda_bar + deviation) - lambda_bar, without cancellation
        lam = lambda_bar + deviation
        root = jnp.sqrt(9 * r * r + 24 * r * lam)
        bottom = 18 * lam + 6 * r
        slope = bar_bottom * (6 + 24 * r / (root + bar_root)) - 18 * bar_top
        slope = slope / (bottom * bar_bottom)
        s = (6 * lam + 3 * r + root) / bottom
        ratio = -3 / 8 * slope * (s + bar_s)
        return deviation * ratio, scaled * (ratio / q), count + 1

    def unsettled(carry):
        return (jnp.abs(carry[0]) > 1e-17) & (carry[2] < 4000)

    start = jnp.asarray(lam, jnp.float64) - lambda_bar
    return while_loop(unsettled, back, (start, start, 0))[1]
