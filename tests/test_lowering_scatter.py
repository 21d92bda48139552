"""Scatters at indices known while tracing, against those of JAX."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid.lowering import scalarise, split


def _row(x, y):
    return x.at[1].set(y)


def _ends(x, y):
    return x.at[0, 1:].add(y[:2]).at[-1, -1].multiply(y[2])


def _repeated(x, y):
    return x.at[jnp.array([0, 1, 0])].add(y)


def _extreme(x, y):
    return x.at[:, 2].min(y[0]).at[:, 0].max(y)


def _dropped(x, y):
    """One of the indices is outside the array."""
    return x.at[jnp.array([1, 7])].add(y, mode="drop")


def _clipped(x, y):
    return x.at[jnp.array([1, 7])].set(y, mode="clip")


def _in_a_batch(x, y):
    """One index for each row."""
    return jax.vmap(lambda row, i, v: row.at[i].add(v))(x, jnp.array([0, 2, 1]), y)


def _rate(x, y):
    """A derivative, whose scatters have other modes."""
    return jax.jvp(lambda a: _repeated(a, a[:, 1]), (x,), (jnp.outer(y, y),))[1]


@pytest.mark.parametrize(
    "function",
    [_row, _ends, _repeated, _extreme, _dropped, _clipped, _in_a_batch, _rate],
)
def test_scatters_of_scalars(function):
    """Equal to JAX, and without an array operation."""
    x, y = jnp.arange(9.0).reshape(3, 3) ** 2, jnp.array([5.5, -3.0, 70.0])
    program = scalarise(function, x, y)

    def call(x, y):
        return [jnp.asarray(e) for e in program(split(x), split(y)).ravel()]

    np.testing.assert_array_equal(jnp.stack(call(x, y)), function(x, y).ravel())
    made = jax.make_jaxpr(call)(x, y)
    assert "scatter" not in str(made)


@pytest.mark.parametrize("size", [9, 200])
def test_other_scatters_remain_operations(size):
    """A function applied to an element, and an update of a long array."""
    x, y = jnp.arange(1.0, size + 1), jnp.array([0.5])

    def function(x, y):
        if size < 10:
            return x.at[1].apply(jnp.sin)
        return x.at[1].set(y[0])

    program = scalarise(function, x, y)

    def call(x, y):
        return [jnp.asarray(e) for e in program(split(x), split(y)).ravel()]

    np.testing.assert_allclose(jnp.stack(call(x, y)), function(x, y), rtol=1e-15)
    assert "scatter" in str(jax.make_jaxpr(call)(x, y))
