"""Run one trajectory in a loop compiled by LLVM."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._started import started
from .backend import Attempts, attempts_of, key_of, laid_out, Rowwise
from .caches import Cache
from .codes import RUNNING
from .loop import Log, log_of, LoopState, numbers_of_row


def _start(case, _=None):
    """Return the plan and the first loop state of a run of a prepared system."""
    _, plan, carried = started(*case, differentiable=False, shared=True)
    return plan, jax.tree.map(jnp.asarray, carried)


# number of attempted steps between two reports of the progress
CHUNK = 2048
_STARTED = Rowwise(_start, width=1)
_LOOPS = Cache()


class _Loop(NamedTuple):
    """The loop of runs whose arguments have the same kinds, and where it finds its
    numbers.
    """

    attempts: Attempts
    # how many numbers belong to the system, of those given; and to the plan, of those
    # computed for the start
    system: int
    plan: int
    # the place of each scalar in the state of the loop
    place: LoopState

    @staticmethod
    def of(system, plan, carried: LoopState) -> "_Loop":
        arrays, static = eqx.partition((system, plan), eqx.is_array)
        of_system, of_plan = (laid_out(part)[1].size for part in arrays)
        _, shared = laid_out(arrays)
        _, nothing = laid_out(jax.tree.map(lambda _: None, arrays))
        numbers, lane = laid_out(carried)
        attempts = attempts_of(key_of(static, nothing, shared, carried, _row, 1))
        place = jax.tree.unflatten(lane.structure, range(len(numbers)))
        return _Loop(attempts, of_system, of_plan, place)


def _row(record, lane: LoopState):
    """Return the place of an attempted step in the log, and the numbers of its row."""
    return lane.steps - 1.0, numbers_of_row(record)


class CompiledRun(NamedTuple):
    """A run by LLVM: the log of its accepted steps, the mode at its start, and the loop
    state at its end, all as numpy arrays and numbers.
    """

    log: Log
    mode: np.ndarray
    end: LoopState


def run_compiled(
    case: tuple,
    budget: int,
    progress: Callable[[float], None] | None = None,
    chunk: int = CHUNK,
) -> CompiledRun:
    """Return a run that is not traced.

    **Arguments:** the prepared system, the settings, t0, the state and t1; the maximum
    number of attempted steps; a function that is called with the time (s) after each
    chunk; and the number of attempted steps in a chunk. Between chunks, a run can be
    interrupted.

    **Raises:** `Lacking` with the name of an operation that the backend does not have.
    """
    started = _STARTED.numbers(case)
    program = started.program

    def make():
        first = jax.tree.map(
            lambda a: a[0] if isinstance(a, np.ndarray) else a,
            program.tree(started.made),
        )
        return _Loop.of(case[0], *first)

    loop = _LOOPS.get(program.function, make)
    made = started.made[0]
    shared = np.concatenate([started.given[: loop.system], made[: loop.plan]])
    lane, own = made[None, loop.plan :].copy(), np.zeros((1, 0))
    place = loop.place
    mode = lane[0, list(place.mode)] > 0.5
    tables, used = [], 0
    while True:
        size = min(chunk, budget - used)
        table = np.zeros((1, size, loop.attempts.sizes.row))
        loop.attempts.run(shared, own, lane, table, first=used, limit=used + size)
        # failed attempts leave a row of the kind `RowKind.NOTHING`, which is zero
        tables.append(table[0, np.flatnonzero(table[0, :, 0] > 0)])
        used += size
        if lane[0, place.status] != RUNNING or used >= budget:
            break
        if progress is not None:
            progress(lane[0, place.t])
    log = log_of(np.concatenate(tables), len(place.x))
    end = jax.tree.map(lambda k: lane[0, k], place)
    return CompiledRun(log, mode, end)
