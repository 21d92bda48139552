"""Run the event loop outside of JAX transformations, in chunks, with LLVM or XLA."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from ._prepared import prepared
from .backend import attempts_of, key_of, Lacking, laid_out, Rowwise, say_lacking
from .codes import RUNNING
from .loop import (
    first_state,
    Functions,
    Log,
    log_of,
    LoopState,
    numbers_of_row,
    Plan,
    run,
)


# number of attempted steps in a chunk; between chunks, progress is reported and a run
# can be interrupted
_CHUNK = 2048


def run_untraced(
    system, settings, t0, state, t1, budget: int, progress: Callable | None
) -> tuple[Log, Any, Int[Array, ""]]:
    """Return the log, the initial mode and the result code of a run.

    A run that has not ended after `budget` attempted steps has the code `RUNNING`.
    """
    case = system, settings, t0, state, t1
    if settings.compiles:
        try:
            return _by_llvm(*case, budget, progress)
        except Lacking as lacking:
            say_lacking(lacking, settings.demands)
    return _by_xla(*case, budget, progress)


def prepare(system, settings, t0, state, t1, differentiable):
    """Return the functions, the plan and the first loop state of a run."""
    return _started(system.prepared(), settings, t0, state, t1, differentiable)


def _started(system, settings, t0, state, t1, differentiable, shared: bool = False):
    functions = Functions(system, state.shape[0], settings.plain, shared=shared)
    plan = Plan.of(system, settings, t0, t1, differentiable=differentiable)
    x = tuple(state[i] for i in range(state.shape[0]))
    carried = first_state(functions, t0, x, t1, plan.longest_step, plan.repeat)
    return functions, plan, carried


def _said(progress, t, t0, t1) -> None:
    if progress is not None:
        progress((float(t) - float(t0)) / max(float(t1) - float(t0), 1e-300))


def _start(case, _=None):
    """Return the plan and the first loop state of a run of a prepared system."""
    _, plan, carried = _started(*case, differentiable=False, shared=True)
    return plan, jax.tree.map(jnp.asarray, carried)


_STARTED = Rowwise(_start, width=1)


def _row(record, lane: LoopState):
    """Return the place of an attempted step in the log, and the numbers of its row."""
    return lane.steps - 1.0, numbers_of_row(record)


def _by_llvm(system, settings, t0, state, t1, budget, progress):
    system = prepared(system)
    case = system, settings, t0, state, t1
    plan, carried = _STARTED.once(case, compiles=True)
    arrays, static = eqx.partition((system, plan), eqx.is_array)
    shared, layout = laid_out(arrays)
    _, nothing = laid_out(jax.tree.map(lambda _: None, arrays))
    numbers, lane = laid_out(carried)
    loop = attempts_of(key_of(static, nothing, layout, carried, _row, 1))
    place = jax.tree.unflatten(lane.structure, range(len(numbers)))
    mode = np.array([numbers[k] > 0.5 for k in place.mode])
    numbers, own = numbers[None], np.zeros((1, 0))
    tables, used = [], 0
    while True:
        size = min(_CHUNK, budget - used)
        table = np.zeros((1, size, loop.sizes.row))
        loop.run(shared, own, numbers, table, first=used, limit=used + size)
        tables.append(table[0])
        used += size
        if numbers[0, place.status] != RUNNING or used >= budget:
            break
        _said(progress, numbers[0, place.t], t0, t1)
    _said(progress, t1, t0, t1)
    log = log_of(np.concatenate(tables), len(place.x))
    return log, mode, jnp.asarray(numbers[0, place.status], jnp.int32)


@eqx.filter_jit
def _begin(system, settings, t0, state, t1, rows):
    functions, plan, carried = prepare(system, settings, t0, state, t1, False)
    mode = jnp.stack(carried.mode)
    carried, log = run(functions, plan, carried, rows, "one")
    return carried, log, mode


@eqx.filter_jit
def _go_on(system, settings, t0, state, t1, carried: LoopState, rows):
    functions, plan, _ = prepare(system, settings, t0, state, t1, False)
    return run(functions, plan, carried, rows, "one")


def _by_xla(system, settings, t0, state, t1, budget, progress):
    case = system, settings, t0, state, t1
    size = min(_CHUNK, budget)
    carried, log, mode = _begin(*case, size)
    logs, used = [log], size
    while float(carried.status) == RUNNING and used < budget:
        _said(progress, carried.t, t0, t1)
        carried, log = _go_on(*case, carried, size)
        logs.append(log)
        used += size
    _said(progress, t1, t0, t1)
    # the last chunk may go beyond the budget: another length would need another program
    whole = jax.tree.map(lambda *parts: np.concatenate(parts)[:budget], *logs)
    status = RUNNING if float(carried.steps) > budget else carried.status
    return whole, mode, jnp.asarray(status, jnp.int32)
