"""Apply Newton's method to the map over one period of a motion."""

import jax
import jax.numpy as jnp

from jaxcam.hybrid import flow, simulate
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.sizes import component_sizes

from .._newton import newton_at_once


_SHORT = 1e-6
"""Fraction of a period over which the direction of the motion is computed."""


def fixed_by_flow(system, guess, length: float, t0, settings, free: bool):
    """Return the state to which the motion returns after a period, and the period (s),
    which is an unknown if it is `free`; None if Newton's method does not converge.
    """
    start, end, normal = jnp.asarray(float(t0)), jnp.asarray(length), None
    if free:
        later = simulate(system, guess, t0, float(t0) + _SHORT * length)
        normal = (jnp.asarray(later.final) - guess) / _sizes(system, start, guess, end)
    state, period, success = _root(system, guess, start, end, settings, normal)
    return (state, float(period)) if bool(success) else None


def _sizes(system, t0, state, length):
    sizes = component_sizes(system, t0, state, length)
    # a component that remains zero has no size
    return jnp.where(sizes > 0, sizes, 1.0)


@program
def _root(system, guess, t0, length, settings, normal):
    """Solve for the state and, if there is a `normal`, for the period: the state then
    stays in the plane through the guess that is perpendicular to the motion.
    """
    sizes = _sizes(system, t0, guess, length)
    free, n = normal is not None, guess.shape[0]

    def moved(y):
        x = y[:n] * sizes
        duration = y[-1] * length if free else length
        after = flow(system, x, t0, t0 + duration, settings=settings).state
        off = (after - x) / sizes
        if free:
            off = jnp.append(off, jnp.dot(normal, (x - guess) / sizes) / _SHORT)
        return off, off

    def evaluate(y):
        matrix, off = jax.jacfwd(moved, has_aux=True)(y)
        return off, matrix

    begin = guess / sizes
    begin = jnp.append(begin, 1.0) if free else begin
    found = newton_at_once(evaluate, lambda _, both: both, begin, 1e-9, 30, False)
    duration = found.y[-1] * length if free else length
    return found.y[:n] * sizes, duration, found.success & (duration > 0)
