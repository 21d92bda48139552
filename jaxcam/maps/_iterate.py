"""Orbits of maps, and diagrams of them."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..parameters import real_array, VectorLike


def iterate(system: Callable, start: ArrayLike | VectorLike, count: int) -> jax.Array:
    """The orbit of `start`, with it: shape `(count + 1, ...)`."""
    start = real_array(start, "start")
    return jnp.concatenate([start[None], _orbit(system, start, count)])


def map_diagram(
    system: eqx.Module,
    where: Callable,
    values: VectorLike,
    start=0.3,
    *,
    transient: int = 1000,
    keep: int = 200,
) -> Float[Array, "values keep"]:
    """What remains of the orbit of one start for each value of a parameter.

    **Arguments:** a map as a Module, `where` that picks the parameter, its values, the
    start, and the numbers of iterates that are dropped and kept.
    """
    values = real_array(values, "values")
    start = real_array(start, "start")
    return _diagram(system, where, values, start, transient, keep)


@eqx.filter_jit
def _orbit(system, start, count):
    def one(x, _):
        x = system(x)
        return x, x

    return jax.lax.scan(one, start, length=count)[1]


@eqx.filter_jit
def _diagram(system, where, values, start, transient, keep):
    def one(value):
        moved = eqx.tree_at(where, system, value)
        settled = jax.lax.fori_loop(0, transient, lambda _, x: moved(x), start)
        return _orbit(moved, settled, keep)

    return jax.vmap(one)(values)
