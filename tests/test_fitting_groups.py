"""Pieces that are evaluated in groups."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.fitting.engine._groups import in_groups


def _piece(x, y):
    return jnp.sin(x) * y, jnp.outer(y, y)


@pytest.mark.parametrize("number", [1, 7, 64, 192])
def test_groups_give_what_vmap_gives(number):
    """To rounding; also with derivatives, and for numbers that no group divides."""
    rng = np.random.default_rng(number)
    x, y = (
        jnp.asarray(rng.normal(size=number)),
        jnp.asarray(rng.normal(size=(number, 3))),
    )
    exists = jnp.asarray(np.arange(number) < max(1, number - 100))
    empty = jnp.zeros(3), jnp.zeros((3, 3))

    @jax.jit
    def both(x):
        one = in_groups(_piece, exists, empty, x, y)
        return one, jax.vmap(_piece)(x, y)

    found, slopes = jax.jvp(both, (x,), (jnp.ones_like(x),))
    for made, wanted in (found, slopes):
        for a, b in zip(made, wanted, strict=True):
            np.testing.assert_allclose(a[exists], b[exists], rtol=1e-14)


def test_a_group_of_padding_is_skipped():
    """Its results are those given, although the function would give NaN there."""
    exists = jnp.asarray(np.arange(128) < 64)
    x = jnp.where(exists, 1.0, -1.0)
    found = jax.jit(lambda: in_groups(jnp.sqrt, exists, jnp.asarray(5.0), x))()
    np.testing.assert_array_equal(found, np.where(exists, 1.0, 5.0))
