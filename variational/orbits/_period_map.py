"""The map over one period by the event loop: its derivatives, and its fixed points.

The loop and its derivatives are compiled by LLVM if possible; otherwise one program of
XLA serves both purposes, because it takes long to compile.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import flow, Settings
from jaxcam.hybrid.flow_jacobian import flow_jacobian, runs_by_llvm
from jaxcam.hybrid.newton import newton_at_once, newton_on_host
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.sizes import component_sizes
from jaxcam.hybrid.surface import onto_contacts
from jaxcam.parameters import as_arrays

from ._builder import builder
from ._direction import direction_of


_TOLERANCE, _ITERATIONS = 1e-9, 30
"""Accuracy of a fixed point, relative to the sizes of the unknowns, and the largest
number of corrections.
"""


def fixed_by_flow(
    system,
    guess,
    length: float,
    t0,
    settings: Settings | None,
    free: bool,
    held: tuple[int, ...] = (),
) -> tuple[Any, float] | None:
    """Return the state near a guess to which the motion returns after a period, and the
    period (s), which is an unknown if it is `free`; None if there is none.

    Newton's method is applied to the map over one period. With an unknown period, the
    state stays in the plane through the guess that is perpendicular to the motion. If
    the motion is never without contact, its constraints are `held`: the state is moved
    onto them before each simulation.
    """
    settings = Settings() if settings is None else settings
    normal = jnp.zeros(len(guess))
    start, period = (jnp.asarray(float(time), jnp.float64) for time in (t0, length))
    if free:
        normal = direction_of(system, jnp.asarray(guess), start, period, settings)
    given = jnp.zeros(0), None, guess, start, period, as_arrays(settings), normal
    sizes = _sizes(system, start, guess, period)
    found = runs_by_llvm(
        settings,
        (system, guess, t0),
        lambda: _fixed_by_llvm(
            system, guess, start, period, settings, normal, sizes, free, held
        ),
    )
    if found is None:
        state, period, success, _ = _over_period(
            system, *given, jnp.asarray(free), jnp.array(False), held
        )
    else:
        state, period, success = found
    if held:
        state = onto_contacts(system, start, jnp.asarray(state), held, sizes)
    return (state, float(period)) if bool(success) else None


def derivatives_by_flow(system, values, where, state, t0, length, settings: Settings):
    """Return the derivatives of the state after a period with respect to the initial
    state, the start time, the period and the parameters `values`.
    """
    no = jnp.asarray(False)
    start, period = (jnp.asarray(time, jnp.float64) for time in (t0, length))
    normal = jnp.zeros(len(state))
    given = values, where, state, start, period, as_arrays(settings), normal
    made = runs_by_llvm(
        settings,
        (system, values, state, start, period),
        lambda: _by_llvm(system, values, where, state, start, period, settings),
    )
    if made is not None:
        return made[1]
    *_, derivatives = _over_period(system, *given, no, ~no)
    return derivatives


def _motion(given, y):
    """Return the system and the motion over a period that belong to the variables."""
    system, where, n, held, sizes = given
    x, start, length, values = y[:n], y[n], y[n + 1], y[n + 2 :]
    built = builder(system, where)(values)
    if held:
        x = onto_contacts(built, start, x, held, sizes)
    return built, x, start, start + length


def _by_llvm(system, values, where, state, t0, length, settings, held=(), sizes=None):
    """Return the state after a period, and its derivatives."""
    n = len(state)
    y = np.concatenate([np.asarray(part).ravel() for part in (state, t0, length)])
    y = np.append(y, np.asarray(values))
    given = system, where, n, held, sizes
    arrival, whole = flow_jacobian(_motion, given, y, settings)
    parts = whole[:, :n], whole[:, n], whole[:, n + 1], whole[:, n + 2 :]
    end = jnp.where(arrival.code == 0, arrival.state, jnp.nan)
    return end, parts


def _fixed_by_llvm(
    system, guess, t0, length, settings, normal, sizes, free: bool, held
):
    """Return the fixed point, the period, and whether there is one."""
    n, guess, normal = len(guess), np.asarray(guess), np.asarray(normal)
    sizes, period = np.asarray(sizes), float(length)

    def evaluate(y):
        at = y[:n] * sizes, t0, y[n] * period
        made = _by_llvm(system, np.zeros(0), None, *at, settings, held, sizes)
        return jax.tree.map(np.asarray, made)

    def equations(y, found):
        return _closing(y[:n] * sizes, guess, period, found, normal, sizes, free, np)

    start = np.append(guess / sizes, 1.0)
    found = newton_on_host(evaluate, equations, start, _TOLERANCE, _ITERATIONS, False)
    duration = found.y[n] * period
    success = found.success and duration > 0
    return jnp.asarray(found.y[:n] * sizes), duration, success


def _sizes(system, t0, state, length):
    sizes = component_sizes(system, t0, state, length)
    # a component that remains zero has no size
    return jnp.where(sizes > 0, sizes, 1.0)


@program
def _over_period(
    system, values, where, guess, t0, length, settings, normal, free, given, held=()
):
    """Return the fixed point, the period, whether there is one, and the derivatives.

    **Arguments:** `free`: whether the period is unknown; `given`: whether the guess is
    the fixed point.
    """
    build, n = builder(system, where), guess.shape[0]
    sizes = _sizes(system, t0, guess, length)

    def moved(x, start, duration, p):
        end = start + duration
        if held:
            x = onto_contacts(build(p), start, x, held, sizes)
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
        derivatives, after = found
        x, _ = unknowns(y)
        found = after, derivatives
        return _closing(x, guess, length, found, normal, sizes, free)

    start = jnp.append(guess / sizes, 1.0)
    found = newton_at_once(evaluate, equations, start, _TOLERANCE, _ITERATIONS, given)
    x, duration = unknowns(found.y)
    return x, duration, found.success & (duration > 0), found.found[0]


def _closing(x, guess, length, found, normal, sizes, free, xp=jnp):
    """Return the equations of a fixed point, relative to the sizes of the components,
    and their Jacobian. The last equation fixes the phase or, with forcing, the period.
    """
    after, (by_state, _, by_length, _) = found
    n = x.shape[0]
    matrix = by_state * sizes[None] / sizes[:, None] - xp.eye(n)
    matrix = xp.column_stack([matrix, by_length * length / sizes])
    off_plane = xp.dot(normal, (x - guess) / sizes)
    across, fixed = xp.append(normal, 0.0), xp.append(xp.zeros(n), 1.0)
    value = xp.append((after - x) / sizes, xp.where(free, off_plane, 0.0))
    return value, xp.vstack([matrix, xp.where(free, across, fixed)])
