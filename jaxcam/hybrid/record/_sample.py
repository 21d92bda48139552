"""Sample the state between integration points by one more step of the same method."""

from types import ModuleType
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from .._prepared import prepared
from .._settings import Settings
from ..backend import Rowwise
from ..breakpoints import between
from ..loop import Functions
from ..programs import program
from ..runge_kutta import step, tableau_of
from ..segments import one_step
from ..surface import field_in_force
from ._events import Steps


def pad(array, fill):
    """Return `array` padded to a power of two, so that few lengths are compiled."""
    array = np.asarray(array)
    length = 64
    while length < array.shape[0]:
        length *= 2
    rest = [(0, length - array.shape[0])] + [(0, 0)] * (array.ndim - 1)
    return jax.device_put(np.pad(array, rest, constant_values=fill))


class _Point(NamedTuple):
    """A sample, and the last integration point before it."""

    # times of the sample, of the point and of the next point
    time: Any
    start: Any
    end: Any
    state: Any
    contact: Any
    # sides of the switching surfaces; empty if there are none
    sides: Any


class _Run(NamedTuple):
    """A run from which samples are taken."""

    # the prepared system
    system: Any
    settings: Settings
    # times of the first and the last point
    first: Any
    last: Any
    # largest distance of each component from its start, to which errors are relative
    scale: Any


def _sampled(run: _Run, point: _Point, shared: bool = True):
    """Return the state at the time of one sample; NaN if the run does not cover it."""
    system, settings, first, last, scale = run
    n = point.state.shape[0]
    functions = Functions(system, n, settings.plain, shared=shared)
    x = tuple(point.state[i] for i in range(n))
    mode = tuple(point.contact[i] for i in range(functions.m))
    sides = [point.sides[i] for i in range(functions.k)]
    mode = mode + tuple(s < 0 for s in sides) + tuple(s == 0 for s in sides)

    def inside(s):
        # no step extends across a breakpoint, so the step to a sample must not either
        if system.breakpoints is None:
            return s
        return between(s, point.start, point.end, last - first)

    place = point.start, x, mode, point.time - point.start
    moved = advance(system, functions, settings, scale, *place, inside)
    room = 1e-12 * jnp.maximum(jnp.abs(first), jnp.abs(last))
    covered = (point.time >= first - room) & (point.time <= last + room)
    return jnp.where(covered, jnp.stack(moved), jnp.nan)


_SAMPLES = Rowwise(_sampled)


def _run_of(system, settings: Settings, steps: Steps, xp: ModuleType) -> _Run:
    last = steps.time[steps.count - 1]
    away = xp.abs(steps.state - steps.state[:1])
    moved = xp.max(away, axis=0, initial=0.0, where=xp.isfinite(steps.state))
    scale = xp.where(moved > 0, moved, 1.0)
    return _Run(system, settings, steps.time[0], last, scale)


def _points_of(steps: Steps, times, xp: ModuleType) -> _Point:
    last = xp.asarray(steps.count, dtype=xp.int64) - 1
    found = xp.searchsorted(steps.time, times, side="right").astype(xp.int64) - 1
    k = xp.clip(found, 0, last)
    sides = xp.zeros((*times.shape, 0)) if steps.sides is None else steps.sides[k]
    end = steps.time[xp.minimum(k + 1, last)]
    return _Point(times, steps.time[k], end, steps.state[k], steps.contact[k], sides)


@program
def sample(system, settings: Settings, steps: Steps, times):
    """Return the states at the given times, `(times, n)`, computed by XLA."""
    run = _run_of(system.prepared(), settings, steps, jnp)
    points = _points_of(steps, times, jnp)
    return jax.vmap(lambda point: _sampled(run, point, shared=False))(points)


def sample_known(system, settings: Settings, steps: Steps, times) -> np.ndarray:
    """Return the states at the given times, `(times, n)`, of an untraced run."""
    known = jax.tree.map(np.asarray, steps)
    if not times.size:
        return np.zeros((0, known.state.shape[1]))
    implicit = isinstance(settings.solver, diffrax.AbstractImplicitSolver)
    run = _run_of(prepared(system), settings, known, np)
    points = _points_of(known, times, np)
    compiles = settings.compiles and not implicit
    return _SAMPLES(run, points, len(times), compiles=compiles)


def advance(
    system, functions: Functions, settings: Settings, scale, t, x, mode, h, inside
):
    """Return the state a time `h` after `(t, x)` in one mode, by one step.

    Functions are evaluated at `inside(time)`; errors are relative to `scale`, `(n,)`.
    """
    moved = _move(system, functions, settings, scale, t, x, mode, h, inside)
    moved, _ = functions.settled(inside(t + h), moved, mode)
    if not functions.m:
        return moved
    held = mode[0]
    for c in mode[1 : functions.m]:
        held = held | c
    if functions.planar:
        moved = tuple(jnp.where(held, a, b) for a, b in zip(x, moved, strict=True))

    def newton(_, point):
        end = inside(t + h)
        jets = functions.jets(end, point, mode)
        return functions.onto(functions.frame(end, point, mode), jets, point, mode)

    return jax.lax.fori_loop(0, 3, newton, moved)


def _move(system, functions, settings, scale, t, x, mode, h, inside):
    if isinstance(settings.solver, diffrax.AbstractImplicitSolver):
        held = jnp.stack(mode[: functions.m])

        def field(s, y):
            return field_in_force(system, inside(s), y, held)

        point = settings.solver, settings.tolerance, field, t, jnp.stack(x), h
        after, _ = one_step(*point, scale)
        return tuple(after[i] for i in range(functions.n))
    tableau = tableau_of(settings.solver)

    def along(s, y):
        return functions.field(inside(s), y, mode)

    return step(tableau, along, t, x, h)[0]
