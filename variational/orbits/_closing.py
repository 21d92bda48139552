"""Refine the impacts of a periodic orbit to the accuracy of its parameters.

A run that locates its impacts loses digits at slow impacts: an error d of the
position changes an impact speed v by about a d / v. As the solution of the shooting
equations the impacts are as well conditioned as the orbit itself, whatever their speed.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float, Int

from jaxcam.hybrid import HybridSystem

from .._flight import fly_linearised
from ._links import landed, matrix_of


# of Newton's method, which starts from a run that has almost closed
_STEPS = 4


class Knots(NamedTuple):
    """The impacts of a period in order, and the errors of the flights between them."""

    rows: Float[np.ndarray, "k n1"]
    """(k, n + 1) time (s) and state just after."""
    before: Float[np.ndarray, "k n"]
    """(k, n) state just before."""
    miss: float
    """Largest closing error of a flight before the first step, relative to the
    scale.
    """


def close(
    system: HybridSystem,
    rows: Float[np.ndarray, "k n1"],
    sides: Int[np.ndarray, " k"],
    period,
    scale: Float[ArrayLike, " n1"],
) -> Knots:
    """Refine the impacts of an orbit without contact; unchanged if that fails.

    `scale` is the size with which a gap and the components of a state are compared.
    The states before impacts are those on arrival of the flights.

    Flights use adaptive steps, so that programs differ only by the number of impacts,
    padded to a power of two.
    """
    number = len(rows)
    length = 1
    while length < number:
        length *= 2
    fill = np.minimum(np.arange(length), number - 1)
    real = np.arange(length) < number
    following = np.where(real, (np.arange(length) + 1) % number, np.arange(length))
    # as an array: a number would be compiled in
    span = np.asarray(period, dtype=float)
    made = _newton(system, rows[fill], sides[fill], real, following, span, scale)
    improved, arrived, misses = map(np.asarray, made)
    first, last = map(float, misses)
    better = np.isfinite(last) and last <= first
    # the flight of row k ends in impact k + 1
    before = np.roll(arrived[int(better), :number], 1, axis=0)
    return Knots(improved[:number] if better else rows, before, first)


@eqx.filter_jit
def _newton(system, rows, sides, real, following, period, scale):
    system = system.prepared()
    # the last real row is followed by the first one, a period later
    wraps = jnp.where(real & (following <= jnp.arange(len(rows))), period, 0.0)

    def one(start, end, which, is_real):
        time = jnp.where(is_real, end, start[0])
        flight = fly_linearised(
            lambda _, t, x: system.vector_field(t, x),
            jnp.zeros(0),
            start[0],
            start[1:],
            time,
        )
        found = landed(system, start, time, which, flight.state, flight.matrix)
        return found, flight.state

    def linear(rows):
        later = rows[following]
        ends = later[:, 0] + wraps
        links, before = jax.vmap(one)(rows, ends, sides[following], real)
        missed = later[:, 1:] - links.value[:, 1:]
        miss = jnp.concatenate([links.value[:, :1], missed], axis=1)
        return links, before, jnp.where(real[:, None], miss, 0.0)

    def newton(_, rows):
        links, _, miss = linear(rows)
        matrix = matrix_of(links, following, real=real)
        if system.period is None:
            # any shift in time is a solution: use the smallest change
            step = jnp.linalg.lstsq(matrix, miss.ravel())[0]
        else:
            step = jnp.linalg.solve(matrix, miss.ravel())
        return rows - step.reshape(rows.shape)

    def judged(rows):
        _, before, miss = linear(rows)
        size = jnp.abs(miss) / scale[None, :]
        # a component that is always zero has no size
        return before, jnp.max(jnp.where(miss == 0, 0.0, size))

    rows = jnp.asarray(rows)
    better = jax.lax.fori_loop(0, _STEPS, newton, rows)
    before, misses = jax.lax.map(judged, jnp.stack([rows, better]))
    return better, before, misses
