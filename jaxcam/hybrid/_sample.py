"""The state between the points of a trajectory, by one more step of the same method."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._events import Steps
from ._functions import Functions
from ._normal import field_in_force
from ._one_step import one_step
from ._runge_kutta import step, tableau_of
from ._settings import Settings


def pad(array, fill):
    """`array` continued to a power of two, so that few lengths are compiled."""
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
    )


@eqx.filter_jit
def sample(system, settings: Settings, steps: Steps, times):
    system = system.prepared()
    n = steps.state.shape[1]
    functions = Functions(system, n)
    last = steps.time[steps.count - 1]

    def one(t):
        found = jnp.searchsorted(steps.time, t, side="right").astype(jnp.int64) - 1
        k = jnp.clip(found, 0, steps.count.astype(jnp.int64) - 1)
        x = tuple(steps.state[k, i] for i in range(n))
        contact = tuple(steps.contact[k, i] for i in range(functions.m))
        start = steps.time[k]
        moved = advance(system, functions, settings, start, x, contact, t - start)
        # beyond what the run covered there is no answer
        room = 1e-12 * (1.0 + jnp.abs(last))
        covered = (t >= steps.time[0] - room) & (t <= last + room)
        return jnp.where(covered, jnp.stack(moved), jnp.nan)

    return jax.vmap(one)(times)


def advance(system, functions: Functions, settings: Settings, t, x, contact, h):
    """The state a time `h` after `(t, x)` in one mode, by one step."""
    moved = _move(system, functions, settings, t, x, contact, h)
    held = contact[0]
    for c in contact[1:]:
        held = held | c
    if functions.planar:
        moved = tuple(jnp.where(held, a, b) for a, b in zip(x, moved, strict=True))

    def newton(_, point):
        jets = functions.jets(t + h, point, contact)
        return functions.onto(functions.frame(t + h, point), jets, point, contact)

    return jax.lax.fori_loop(0, 3, newton, moved)


def _move(system, functions, settings, t, x, contact, h):
    if isinstance(settings.solver, diffrax.AbstractImplicitSolver):
        held = jnp.stack(contact)

        def field(s, y):
            return field_in_force(system, s, y, held)

        after, _ = one_step(
            settings.solver, settings.tolerance, field, t, jnp.stack(x), h
        )
        return tuple(after[i] for i in range(functions.n))
    tableau = tableau_of(settings.solver)
    moved, _, _ = step(tableau, lambda s, y: functions.field(s, y, contact), t, x, h)
    return moved
