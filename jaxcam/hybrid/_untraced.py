"""Run the event loop outside of JAX transformations, in chunks, with LLVM or XLA."""

from collections.abc import Callable
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Int

from ._compiled_run import CHUNK, run_compiled
from ._prepared import prepared
from ._started import started
from .backend import Lacking, say_lacking
from .codes import RUNNING
from .loop import Log, LoopState, run


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
    return started(system.prepared(), settings, t0, state, t1, differentiable)


def _said(progress, t, t0, t1) -> None:
    if progress is not None:
        progress((float(t) - float(t0)) / max(float(t1) - float(t0), 1e-300))


def _by_llvm(system, settings, t0, state, t1, budget, progress):
    case = prepared(system), settings, t0, state, t1
    made = run_compiled(case, budget, lambda t: _said(progress, t, t0, t1))
    _said(progress, t1, t0, t1)
    return made.log, made.mode, jnp.asarray(made.end.status, jnp.int32)


@eqx.filter_jit
def _begin(system, settings, t0, state, t1, rows):
    functions, plan, carried = prepare(system, settings, t0, state, t1, False)
    mode = carried.flags
    carried, log = run(functions, plan, carried, rows, "one")
    return carried, log, mode


@eqx.filter_jit
def _go_on(system, settings, t0, state, t1, carried: LoopState, rows):
    functions, plan, _ = prepare(system, settings, t0, state, t1, False)
    return run(functions, plan, carried, rows, "one")


def _by_xla(system, settings, t0, state, t1, budget, progress):
    case = system, settings, t0, state, t1
    size = min(CHUNK, budget)
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
