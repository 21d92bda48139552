"""Piecewise-smooth maps of one variable with a border at zero (thesis, eq. 2.20)."""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp


def _parameter(default=None):
    def convert(value):
        return jnp.asarray(value, dtype=float)

    if default is None:
        return eqx.field(converter=convert)
    return eqx.field(default=default, converter=convert)


class PiecewiseMap(eqx.Module):
    """A map with one rule for x <= 0 and another for x > 0.

    Subclass it and define both rules; for `border_collision`, they must be smooth at
    zero.

    Examples:
        >>> from jaxcam.maps import PiecewiseMap
        >>> class Tent(PiecewiseMap):
        ...     def left(self, x):
        ...         return 1 + 2 * x
        ...     def right(self, x):
        ...         return 1 - 2 * x
        >>> float(Tent()(0.25))
        0.5
    """

    @abc.abstractmethod
    def left(self, x) -> jax.Array:
        """Return the image of x <= 0."""

    @abc.abstractmethod
    def right(self, x) -> jax.Array:
        """Return the image of x > 0."""

    def __call__(self, x) -> jax.Array:
        return jnp.where(x > 0, self.right(x), self.left(x))


class SkewMap(PiecewiseMap):
    """Skew tent map x -> a x + mu for x <= 0, b x + mu + jump for x > 0.

    It is the normal form of a border collision if `jump` is zero, and that of a
    discontinuous map otherwise (thesis, Figure 2.11 (a) and (b)).

    Examples:
        >>> from jaxcam.maps import SkewMap
        >>> float(SkewMap(a=0.5, b=-2.0, mu=1.0)(1.0))
        -1.0
    """

    a: jax.Array = _parameter()
    """Slope for x <= 0."""
    b: jax.Array = _parameter()
    """Slope for x > 0."""
    mu: jax.Array = _parameter()
    """Parameter mu."""
    jump: jax.Array = _parameter(0.0)
    """Jump at the border."""

    def left(self, x) -> jax.Array:
        """Return a x + mu."""
        return self.a * x + self.mu

    def right(self, x) -> jax.Array:
        """Return b x + mu + jump."""
        return self.b * x + self.mu + self.jump


class SquareRootMap(PiecewiseMap):
    """Square-root map x -> a x + mu for x <= 0, mu - root sqrt(x) for x > 0.

    The Poincaré map near a grazing impact has this form (thesis, Figure 2.11 (c)).

    Examples:
        >>> from jaxcam.maps import SquareRootMap
        >>> float(SquareRootMap(a=0.5, mu=0.1)(0.25))
        -0.4
    """

    a: jax.Array = _parameter()
    """Slope for x <= 0."""
    mu: jax.Array = _parameter()
    """Parameter mu."""
    root: jax.Array = _parameter(1.0)
    """Factor of the square root."""

    def left(self, x) -> jax.Array:
        """Return a x + mu."""
        return self.a * x + self.mu

    def right(self, x) -> jax.Array:
        """Return mu - root sqrt(x)."""
        # for x <= 0 the value is not used, but it must be finite and differentiable
        return self.mu - self.root * jnp.sqrt(jnp.where(x > 0, x, 1.0))
