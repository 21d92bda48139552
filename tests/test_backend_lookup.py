"""Lookups in long arrays by the LLVM backend against XLA, and systems that use them."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax
from test_backend_operations import assert_equal, both

from jaxcam import HybridSystem, Settings, simulate
from jaxcam.hybrid.backend import Mapped, vector_width


_RNG = np.random.default_rng(3)
_TABLE = _RNG.normal(size=300)
_FLAGS = _TABLE > 0
_PAGES = _RNG.normal(size=(12, 20))


def _place(x):
    return jnp.floor(x).astype(int)


_LOOKUPS = {
    "element": lambda x, y: jnp.asarray(_TABLE)[_place(x)],
    "clipped": lambda x, y: jnp.asarray(_TABLE).at[_place(x)].get(mode="clip"),
    "filled": lambda x, y: jnp.asarray(_TABLE).at[_place(x)].get(mode="fill"),
    "fill value": lambda x, y: (
        jnp.asarray(_TABLE).at[_place(x)].get(mode="fill", fill_value=7.0)
    ),
    "flag": lambda x, y: jnp.asarray(_FLAGS)[_place(x)],
    "slice": lambda x, y: list(
        lax.dynamic_slice(jnp.asarray(_TABLE), (_place(x),), (3,))
    ),
    "short index": lambda x, y: jnp.asarray(_TABLE)[jnp.floor(x).astype(jnp.int32)] * y,
    "several": lambda x, y: jnp.sum(
        jnp.asarray(_TABLE)[jnp.stack([_place(x), _place(y)])]
    ),
    "of a matrix": lambda x, y: jnp.asarray(_PAGES)[_place(x / 10), _place(y)],
    "row": lambda x, y: list(jnp.asarray(_PAGES)[_place(x / 10)]),
    "block": lambda x, y: list(
        lax.dynamic_slice(
            jnp.asarray(_PAGES), (_place(x / 10), _place(y)), (2, 3)
        ).ravel()
    ),
    "computed": lambda x, y: (y * jnp.asarray(_TABLE))[_place(x)],
    "interpolated": lambda x, y: jnp.interp(x, jnp.arange(300.0), jnp.asarray(_TABLE)),
}


@pytest.mark.parametrize("width", sorted({1, 2, vector_width()}))
@pytest.mark.parametrize("name", _LOOKUPS)
def test_lookups_are_those_of_xla(name, width):
    """Equal bit by bit, at indices below, inside and above the array; to 1e-15 where
    XLA may fuse a product and a sum."""
    own = np.stack([_RNG.uniform(-20, 340, 101), _RNG.uniform(-5, 25, 101)], axis=1)
    mine, made = both(_LOOKUPS[name], own, width)
    if name == "interpolated":
        np.testing.assert_allclose(mine, made, rtol=1e-14, atol=1e-15)
    else:
        assert_equal(mine, made)


@pytest.mark.parametrize("width", sorted({1, 2, vector_width()}))
def test_lookups_in_arrays_of_each_element_and_of_all(width):
    """A table that all batch elements share, and one for each of them."""
    own = np.concatenate(
        [_RNG.uniform(-3, 103, (37, 1)), _RNG.normal(size=(37, 100))], 1
    )

    def looked_up(shared, own):
        at = _place(own[0])
        return [shared[50:][at], own[1:][at], shared[at] - own[1:][at]]

    mine = Mapped(looked_up, 300, 101, width)(_TABLE, own)
    made = jax.vmap(lambda row: jnp.stack(looked_up(jnp.asarray(_TABLE), row)))(own)
    np.testing.assert_array_equal(mine, made)


class _Follower(HybridSystem):
    """A ball on a surface whose measured height is a table over one period."""

    heights: jax.Array

    @property
    def period(self):
        return 1.0

    def _surface(self, t):
        number = self.heights.shape[0]
        at = (t % 1.0) * number
        first = jnp.floor(at).astype(int)
        u = at - jnp.floor(at)
        y0, y1, y2, y3 = (self.heights[(first + k) % number] for k in range(-1, 3))
        a, b = (y2 - y0) / 2, y0 - 2.5 * y1 + 2 * y2 - 0.5 * y3
        return y1 + u * (a + u * (b + u * (0.5 * (y3 - y0) + 1.5 * (y1 - y2))))

    def vector_field(self, t, state):
        return jnp.stack([state[1], jnp.asarray(-9.81)])

    def gap(self, t, state):
        return state[0] - self._surface(t)

    def impact(self, t, state):
        _, rate = jax.jvp(self._surface, (t,), (jnp.ones_like(t),))
        return jnp.stack([state[0], rate - 0.6 * (state[1] - rate)])


def _heights(number: int):
    angle = 2 * np.pi * np.arange(number) / number
    return jnp.asarray(0.02 * np.cos(angle) + 0.004 * np.sin(3 * angle))


def test_a_measured_surface_runs_in_the_backend():
    """Impacts of a system with a table of 360 heights: times to 1e-9 of XLA's, and
    without the warning that it runs with XLA."""
    system, start = _Follower(_heights(360)), jnp.array([0.3, 0.0])
    one = simulate(system, start, 0.0, 2.0, settings=Settings(backend="llvm"))
    other = simulate(system, start, 0.0, 2.0, settings=Settings(backend="xla"))
    assert int(one.impacts.count) == int(other.impacts.count) > 3
    np.testing.assert_allclose(one.impacts.time, other.impacts.time, atol=1e-9)


def test_the_program_of_a_table_has_few_operations():
    """A table of 2000 numbers adds less than a tenth to the operations of one with 80:
    its elements are not traced one by one."""

    def size(number: int) -> int:
        system = _Follower(_heights(number))
        made = jax.make_jaxpr(
            lambda x: simulate(system, x, 0.0, 0.1, max_steps=8).final
        )
        return len(str(made(jnp.array([0.3, 0.0]))).splitlines())

    assert size(2000) < 1.1 * size(80)
