"""The one-dimensional square-root map near grazing, and its windows."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float


def nordmark_map(x: ArrayLike, mu: ArrayLike, lam: ArrayLike) -> Float[Array, "..."]:
    """sqrt(mu - x) + lam mu where x <= mu, and lam x elsewhere.

    What remains of [`variational.GrazingForm`][] where one multiplier `lam` in (0, 1)
    outlives the others: x is the gap at the graze less that of the orbit that would
    pass through the wall, and mu its depth, both over the square of the coefficient
    (Nordmark, Journal of Sound and Vibration 145, 1991).
    """
    x, mu, lam = (jnp.asarray(a, dtype=jnp.float64) for a in (x, mu, lam))
    hits = x <= mu
    root = jnp.sqrt(jnp.where(hits, mu - x, 1.0))
    return jnp.where(hits, root + lam * mu, lam * x)


def nordmark_window(lam: float, period: int) -> tuple[float, float]:
    """Between which mu the orbit with one impact in `period` turns is stable.

        3 lam^(2m-2) / (4 (1 - lam^m)) < mu < lam^(2m-4) (1 - lam) / (1 - lam^(m-1))^2

    At the upper end the orbit grazes, at the lower one it loses stability by a flip
    (Chin, Ott, Nusse and Grebogi, Physical Review E 50, 1994). Where the lower bound is
    not below the upper one there is no window.

    Raises:
        ValueError: For lam outside (0, 1) or a period below 2.
    """
    if not 0 < lam < 1:
        raise ValueError(f"lam is {lam:g}; windows are known for 0 < lam < 1")
    if period < 2:
        raise ValueError(f"period is {period}; give the number of turns, 2 or more")
    m = period
    low = 3 * lam ** (2 * m - 2) / (4 * (1 - lam**m))
    high = lam ** (2 * m - 4) * (1 - lam) / (1 - lam ** (m - 1)) ** 2
    return low, high
