"""The one-dimensional square-root map near grazing, and its periodic windows."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float


def nordmark_map(x: ArrayLike, mu: ArrayLike, lam: ArrayLike) -> Float[Array, "..."]:
    """Return sqrt(mu - x) + lam mu for x <= mu, and lam x otherwise.

    This is the limit of [`variational.GrazingForm`][] if one multiplier `lam` in (0, 1)
    dominates the others: x is the smallest gap minus that of the orbit that would pass
    through the constraint, and mu is the depth of that orbit, both divided by the
    square of `GrazingForm.coefficient` (Nordmark, Journal of Sound and Vibration 145,
    1991).

    Args:
        x: Scaled gap, any shape.
        mu: Scaled depth, broadcast against `x`.
        lam: Dominant multiplier, between 0 and 1.

    Returns:
        The next x, in the broadcast shape.

    Examples:
        >>> from variational import nordmark_map
        >>> float(nordmark_map(0.0, 0.25, 0.5))
        0.625
    """
    x, mu, lam = (jnp.asarray(a, dtype=jnp.float64) for a in (x, mu, lam))
    hits = x <= mu
    root = jnp.sqrt(jnp.where(hits, mu - x, 1.0))
    return jnp.where(hits, root + lam * mu, lam * x)


def nordmark_window(lam: float, period: int) -> tuple[float, float]:
    """Return the interval of the parameter mu of [`variational.nordmark_map`][] in
    which the orbit with one impact per `period` iterations is stable.

        3 lam^(2m-2) / (4 (1 - lam^m)) < mu < lam^(2m-4) (1 - lam) / (1 - lam^(m-1))^2

    At the upper end, the orbit grazes; at the lower end, it loses stability in a flip
    (Chin, Ott, Nusse and Grebogi, Physical Review E 50, 1994). If the lower bound is
    not below the upper one, there is no window.

    Args:
        lam: Dominant multiplier, between 0 and 1.
        period: Number m of iterations between impacts, at least 2.

    Returns:
        Lower and upper bounds of mu.

    Raises:
        ValueError: `lam` is outside (0, 1), or the period is below 2.

    Examples:
        >>> from variational import nordmark_window
        >>> low, high = nordmark_window(0.2, 3)
        >>> low < high
        True
    """
    if not 0 < lam < 1:
        raise ValueError(f"lam is {lam:g}; windows are known for 0 < lam < 1")
    if period < 2:
        raise ValueError(
            f"period is {period}; give the number of iterations, 2 or more"
        )
    m = period
    low = 3 * lam ** (2 * m - 2) / (4 * (1 - lam**m))
    high = lam ** (2 * m - 4) * (1 - lam) / (1 - lam ** (m - 1)) ** 2
    return low, high
