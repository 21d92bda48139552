"""Classify the attractor of an orbit: a cycle with its period, or chaos."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp

from ..hybrid.programs import program
from ..parameters import real_array


class Attractor(NamedTuple):
    """The attractor to which an orbit converges."""

    period: int
    """Smallest detected period; 0 if there is none."""
    lyapunov: float
    """Lyapunov exponent: the mean of log |f'| along the orbit of the map f, positive
    for a chaotic orbit.
    """
    bounded: bool
    """Whether the orbit stayed finite."""

    @property
    def kind(self) -> str:
        """The kind of attractor, in words."""
        if not self.bounded:
            return "none"
        if self.period == 1:
            return "fixed point"
        if self.period:
            return f"period {self.period}"
        return "chaos" if self.lyapunov > 0 else "longer period"


def map_attractor(
    system: Callable,
    start=0.1,
    *,
    transient: int = 20_000,
    count: int = 20_000,
    longest: int = 64,
) -> Attractor:
    """Classify the attractor to which the orbit of `start` converges.

    Args:
        system: A map of one variable, differentiable except on borders.
        start: First point.
        transient: Number of initial iterates to discard.
        count: Number of iterates to use.
        longest: Longest period to detect.

    Returns:
        An `Attractor`.

    Examples:
        >>> from jaxcam.maps import LogisticMap, map_attractor
        >>> map_attractor(LogisticMap(3.2), transient=1000, count=1000).period
        2
    """
    start = real_array(start, "start")
    last, rate, bounded, period = _settle(system, start, transient, count, longest)
    del last
    return Attractor(int(period), float(rate), bool(bounded))


@program
def _settle(system, start, transient, count, longest):
    x = jax.lax.fori_loop(0, transient, lambda _, x: system(x), start)

    def one(carry, _):
        x, total = carry
        following, slope = jax.jvp(system, (x,), (jnp.ones_like(x),))
        # a superstable orbit has no finite exponent
        total = total + jnp.log(jnp.maximum(jnp.abs(slope), 1e-300))
        return (following, total), None

    (x, total), _ = jax.lax.scan(one, (x, jnp.zeros(())), length=count)

    def image(y, _):
        y = system(y)
        return y, y

    _, images = jax.lax.scan(image, x, length=longest)
    bounded = jnp.all(jnp.isfinite(images)) & (jnp.abs(x) < 1e12)
    close = jnp.abs(images - x) <= 1e-9 * (1 + jnp.abs(x))
    period = jnp.where(jnp.any(close), jnp.argmax(close) + 1, 0)
    return x, total / count, bounded, jnp.where(bounded, period, 0)
