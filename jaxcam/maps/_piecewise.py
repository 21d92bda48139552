"""Piecewise-smooth maps of one variable, with their border at zero (thesis,
eq. 2.20).
"""

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

    Subclass it and state both; for `border_collision` they must be smooth at zero.
    """

    @abc.abstractmethod
    def left(self, x) -> jax.Array:
        """The image of x <= 0."""

    @abc.abstractmethod
    def right(self, x) -> jax.Array:
        """The image of x > 0."""

    def __call__(self, x) -> jax.Array:
        return jnp.where(x > 0, self.right(x), self.left(x))


class SkewMap(PiecewiseMap):
    """x -> a x + mu for x <= 0, b x + mu + jump for x > 0. (Figure 2.11 (a) and (b))

    The normal form of a border collision where `jump` is zero; with a jump, that of a
    discontinuous map.
    """

    a: jax.Array = _parameter()
    b: jax.Array = _parameter()
    mu: jax.Array = _parameter()
    jump: jax.Array = _parameter(0.0)

    def left(self, x) -> jax.Array:
        """a x + mu."""
        return self.a * x + self.mu

    def right(self, x) -> jax.Array:
        """b x + mu + jump."""
        return self.b * x + self.mu + self.jump


class SquareRootMap(PiecewiseMap):
    """x -> a x + mu for x <= 0, mu - root sqrt(x) for x > 0. (Figure 2.11 (c))

    What a grazing impact does to the Poincare map, close to it.
    """

    a: jax.Array = _parameter()
    mu: jax.Array = _parameter()
    root: jax.Array = _parameter(1.0)

    def left(self, x) -> jax.Array:
        """a x + mu."""
        return self.a * x + self.mu

    def right(self, x) -> jax.Array:
        """mu - root sqrt(x)."""
        # of no consequence on the other side, but finite and differentiable there
        return self.mu - self.root * jnp.sqrt(jnp.where(x > 0, x, 1.0))
