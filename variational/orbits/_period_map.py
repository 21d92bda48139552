"""The map over one period by the event loop: its derivatives, and its fixed points.

One program serves both purposes, because it takes long to compile.
"""

from typing import Any

import jax
import jax.numpy as jnp

from jaxcam.hybrid import flow, Settings, simulate
from jaxcam.hybrid.newton import newton_at_once
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.sizes import component_sizes
from jaxcam.parameters import as_arrays

from ._builder import builder


_SHORT = 1e-6
"""Fraction of a period over which the direction of the motion is computed."""
_TOLERANCE, _ITERATIONS = 1e-9, 30
"""Accuracy of a fixed point, relative to the sizes of the unknowns, and the largest
number of corrections.
"""


def fixed_by_flow(
    system, guess, length: float, t0, settings: Settings | None, free: bool
) -> tuple[Any, float] | None:
    """Return the state near a guess to which the motion returns after a period, and the
    period (s), which is an unknown if it is `free`; None if there is none.

    Newton's method is applied to the map over one period. With an unknown period, the
    state stays in the plane through the guess that is perpendicular to the motion.
    """
    settings = Settings() if settings is None else settings
    normal = jnp.zeros(len(guess))
    start, period = (jnp.asarray(float(time), jnp.float64) for time in (t0, length))
    if free:
        short = float(t0) + _SHORT * length
        later = simulate(system, guess, t0, short, settings=settings)
        sizes = _sizes(system, start, guess, period)
        normal = (jnp.asarray(later.final) - guess) / sizes
    given = jnp.zeros(0), None, guess, start, period, as_arrays(settings), normal
    state, period, success, _ = _over_period(
        system, *given, jnp.asarray(free), jnp.array(False)
    )
    return (state, float(period)) if bool(success) else None


def derivatives_by_flow(system, values, where, state, t0, length, settings: Settings):
    """Return the derivatives of the state after a period with respect to the initial
    state, the start time, the period and the parameters `values`.
    """
    no = jnp.asarray(False)
    start, period = (jnp.asarray(time, jnp.float64) for time in (t0, length))
    normal = jnp.zeros(len(state))
    given = values, where, state, start, period, as_arrays(settings), normal
    *_, derivatives = _over_period(system, *given, no, ~no)
    return derivatives


def _sizes(system, t0, state, length):
    sizes = component_sizes(system, t0, state, length)
    # a component that remains zero has no size
    return jnp.where(sizes > 0, sizes, 1.0)


@program
def _over_period(
    system, values, where, guess, t0, length, settings, normal, free, given
):
    """Return the fixed point, the period, whether there is one, and the derivatives.

    **Arguments:** `free`: whether the period is unknown; `given`: whether the guess is
    the fixed point.
    """
    build, n = builder(system, where), guess.shape[0]
    sizes = _sizes(system, t0, guess, length)

    def moved(x, start, duration, p):
        end = start + duration
        state = flow(build(p), x, start, end, settings=settings).state
        return state, state

    def unknowns(y):
        # without rounding, if they are given
        x = jnp.where(given, guess, y[:n] * sizes)
        return x, jnp.where(given, length, y[n] * length)

    def evaluate(y):
        x, duration = unknowns(y)
        derivative = jax.jacfwd(moved, argnums=(0, 1, 2, 3), has_aux=True)
        return derivative(x, t0, duration, values)

    def equations(y, found):
        (by_state, _, by_length, _), after = found
        x, _ = unknowns(y)
        matrix = by_state * sizes[None] / sizes[:, None] - jnp.eye(n)
        matrix = jnp.column_stack([matrix, by_length * length / sizes])
        off_plane = jnp.dot(normal, (x - guess) / sizes) / _SHORT
        across = jnp.append(normal / _SHORT, 0.0)
        fixed = jnp.zeros(n + 1).at[n].set(1.0)
        value = jnp.append((after - x) / sizes, jnp.where(free, off_plane, 0.0))
        return value, jnp.vstack([matrix, jnp.where(free, across, fixed)])

    start = jnp.append(guess / sizes, 1.0)
    found = newton_at_once(evaluate, equations, start, _TOLERANCE, _ITERATIONS, given)
    x, duration = unknowns(found.y)
    return x, duration, found.success & (duration > 0), found.found[0]
