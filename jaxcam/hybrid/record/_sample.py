"""Sample the state between points by one additional step of the same method."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from .._settings import Settings
from ..breakpoints import between
from ..loop import Functions
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


def padded(steps: Steps) -> Steps:
    return Steps(
        pad(steps.time, np.inf),
        pad(steps.state, np.nan),
        pad(steps.contact, False),
        steps.count,
        None if steps.sides is None else pad(steps.sides, 1.0),
    )


@eqx.filter_jit
def sample(system, settings: Settings, steps: Steps, times):
    system = system.prepared()
    n = steps.state.shape[1]
    functions = Functions(system, n, settings.plain)
    last = steps.time[steps.count - 1]
    moved = jnp.max(jnp.abs(steps.state - steps.state[:1]), axis=0, initial=0.0,
                    where=jnp.isfinite(steps.state))  # fmt: skip
    scale = jnp.where(moved > 0, moved, 1.0)

    def one(t):
        found = jnp.searchsorted(steps.time, t, side="right").astype(jnp.int64) - 1
        k = jnp.clip(found, 0, steps.count.astype(jnp.int64) - 1)
        x = tuple(steps.state[k, i] for i in range(n))
        mode = tuple(steps.contact[k, i] for i in range(functions.m))
        if steps.sides is not None:
            sides = [steps.sides[k, i] for i in range(functions.k)]
            mode = mode + tuple(s < 0 for s in sides) + tuple(s == 0 for s in sides)
        start = steps.time[k]
        end = steps.time[jnp.minimum(k + 1, steps.count.astype(jnp.int64) - 1)]
        span = last - steps.time[0]

        def inside(s):
            # no step extends across a breakpoint, so no sample of a step does
            return s if system.breakpoints is None else between(s, start, end, span)

        point = start, x, mode, t - start
        moved = advance(system, functions, settings, scale, *point, inside)
        # NaN beyond the interval of the run
        room = 1e-12 * jnp.maximum(jnp.abs(steps.time[0]), jnp.abs(last))
        covered = (t >= steps.time[0] - room) & (t <= last + room)
        return jnp.where(covered, jnp.stack(moved), jnp.nan)

    return jax.vmap(one)(times)


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
