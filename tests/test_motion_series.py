"""Time derivatives along a motion by recurrences, against nested derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid.lowering import motion_series, split
from jaxcam.hybrid.surface import along_path, motion_rates


def _forced(p, t, x):
    """Only operations with a recurrence; some numbers depend on time alone."""
    drive = jnp.sin(p * t) / (1 + jnp.cos(t) ** 2)
    field = jnp.stack([x[1], drive - x[0] ** 3 - jnp.where(x[1] > 0, 0.3, 0.1) * x[1]])
    watched = jnp.sqrt(2 + x[0] * drive) / (x[1] - 3 * t), jnp.tan(x[0]) - drive
    return field, (jnp.stack(watched), jnp.maximum(x[0], x[1])[None])


def _updated(p, t, x):
    """Elements that are changed, absolute values, and negative powers."""
    field = jnp.zeros(2).at[0].set(x[1]).at[1].add(-(jnp.abs(x[0] - t * p) ** 3))
    inverse = jax.lax.integer_pow(1 + x[0] ** 2, -2)
    watched = x.at[1].multiply(inverse), jnp.abs(x.at[0].add(-5.0))
    return field, (watched[0], watched[1][:1] + x[0] ** 0)


def _mixed(p, t, x):
    """Operations without a recurrence, and linear algebra."""
    matrix = jnp.array([[2.0, 0.3], [0.3, 1.0]]) + jnp.outer(x, x)
    pull = jnp.linalg.solve(matrix, jnp.exp(-p * x) + jnp.tanh(t))
    field = jnp.stack([x[1], -pull[0]])
    return field, (jnp.log(2 + pull**2), jnp.arctan2(x, pull)[:1])


@pytest.mark.parametrize("function", [_forced, _updated, _mixed])
def test_derivatives_along_a_motion(function):
    """All derivatives up to the third."""
    p, t, x = jnp.asarray(1.7), jnp.asarray(0.4), jnp.array([0.6, 0.35])
    rates = motion_rates(lambda s, y: function(p, s, y)[0], t, x)
    wanted = along_path(lambda s, y: function(p, s, y)[1], t, x, rates, 3)

    @jax.jit
    def found(p, t, x):
        series = motion_series(function, (3, 2), p, t, x)(split(p), t, split(x))
        joined = [jnp.stack([jnp.asarray(e) for e in rate]) for rate in series.rates]
        along = [
            [jnp.stack([jnp.asarray(e) for e in part]) for part in parts]
            for parts in series.along
        ]
        return joined, along

    made, along = found(p, t, x)
    np.testing.assert_allclose(made, rates, rtol=1e-12, atol=1e-13)
    for order, (ours, theirs) in enumerate(zip(along, wanted, strict=True)):
        np.testing.assert_allclose(ours[0], theirs[0], rtol=1e-11, atol=1e-12)
        last = theirs[1] if order <= 2 else jnp.zeros(1)
        np.testing.assert_allclose(ours[1], last, rtol=1e-11, atol=1e-12)
