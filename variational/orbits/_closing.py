"""Refine the impacts of a periodic orbit to the accuracy of its parameters.

A run that locates its impacts loses digits at slow impacts: an error d of the position
changes an impact speed v by about a d / v, where a is the acceleration. As a solution
of the shooting equations, the impacts are as well conditioned as the orbit itself,
regardless of their speed.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import ArrayLike, Float, Int

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.programs import program

from .._flight import fly_linearised
from ._links import landed, matrix_of


# iterations of Newton's method, which starts from a run that has almost closed
_STEPS = 4


class Knots(NamedTuple):
    """The impacts of a period in order, and the errors of the flights between them."""

    rows: Float[np.ndarray, "k n1"]
    """Time (s) and state just after each impact, (k, n + 1)."""
    before: Float[np.ndarray, "k n"]
    """State just before each impact, (k, n)."""
    miss: float
    """Largest closing error of a flight before the first Newton step, relative to the
    scale.
    """


def close(
    system: HybridSystem,
    rows: Float[np.ndarray, "k n1"],
    sides: Int[np.ndarray, " k"],
    period,
    scale: Float[ArrayLike, " n1"],
) -> Knots:
    """Return the refined impacts of an orbit without contact, or the impacts unchanged
    if the refinement fails.

    `scale` is the size to which gaps and state components are relative. The states
    before impacts are those at the ends of the flights.

    Flights use adaptive steps, so programs differ only in the number of impacts, which
    is padded to a power of two.
    """
    number = len(rows)
    length = 1
    while length < number:
        length *= 2
    fill = np.minimum(np.arange(length), number - 1)
    real = np.arange(length) < number
    following = np.where(real, (np.arange(length) + 1) % number, np.arange(length))
    # pass an array, because a number would be compiled into the program
    span = np.asarray(period, dtype=float)
    made = _newton(system, rows[fill], sides[fill], real, following, span, scale)
    improved, arrived, misses = map(np.asarray, made)
    first, last = map(float, misses)
    better = np.isfinite(last) and last <= first
    # the flight of row k ends in impact k + 1
    before = np.roll(arrived[int(better), :number], 1, axis=0)
    return Knots(improved[:number] if better else rows, before, first)


@program
def _newton(system, rows, sides, real, following, period, scale):
    system = system.prepared()
    # the last valid row is followed by the first one, a period later
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
            # any time shift yields another solution, so the smallest change is used
            step = jnp.linalg.lstsq(matrix, miss.ravel())[0]
        else:
            step = jnp.linalg.solve(matrix, miss.ravel())
        return rows - step.reshape(rows.shape)

    def judged(rows):
        _, before, miss = linear(rows)
        size = jnp.abs(miss) / scale[None, :]
        # a component that is always zero has no scale
        return before, jnp.max(jnp.where(miss == 0, 0.0, size))

    rows = jnp.asarray(rows)
    better = jax.lax.fori_loop(0, _STEPS, newton, rows)
    before, misses = jax.lax.map(judged, jnp.stack([rows, better]))
    return better, before, misses
