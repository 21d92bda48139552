"""Orbits of maps, and their bifurcation diagrams."""

from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..hybrid.programs import program
from ..parameters import real_array, VectorLike


def iterate(system: Callable, start: ArrayLike | VectorLike, count: int) -> jax.Array:
    """Iterate a map and return the orbit.

    Args:
        system: The map.
        start: First point, any shape.
        count: Number of iterations.

    Returns:
        The orbit, including its start, shape `(count + 1, ...)`.

    Examples:
        >>> from jaxcam.maps import LogisticMap, iterate
        >>> iterate(LogisticMap(2.0), 0.25, 2).tolist()
        [0.25, 0.375, 0.46875]
    """
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
    """Return the steady-state orbit from a given start for each value of a parameter.

    Args:
        system: The map, an `equinox.Module`.
        where: Selects the parameter.
        values: Values of the parameter, shape `(values,)`.
        start: First point.
        transient: Number of initial iterates to discard.
        keep: Number of iterates to keep.

    Returns:
        Iterates, shape `(values, keep)`.

    Examples:
        >>> from jaxcam.maps import LogisticMap, map_diagram
        >>> map_diagram(LogisticMap(), lambda m: m.mu, [2.0, 3.2], keep=4).shape
        (2, 4)
    """
    values = real_array(values, "values")
    start = real_array(start, "start")
    return _diagram(system, where, values, start, transient, keep)


@program
def _orbit(system, start, count):
    def one(x, _):
        x = system(x)
        return x, x

    return jax.lax.scan(one, start, length=count)[1]


@program
def _diagram(system, where, values, start, transient, keep):
    def one(value):
        moved = eqx.tree_at(where, system, value)
        settled = jax.lax.fori_loop(0, transient, lambda _, x: moved(x), start)
        return _orbit(moved, settled, keep)

    return jax.vmap(one)(values)
