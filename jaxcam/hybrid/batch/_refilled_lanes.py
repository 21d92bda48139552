"""Run many batch elements in fewer positions, each refilled when its element ends."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from ..backend import (
    attempts_of,
    cuda_attempts_of,
    key_of,
    Lacking,
    laid_out,
    say_lacking,
    vector_width,
)
from ..codes import FINISHED, RUNNING
from ..loop import iteration, loop_state
from ..lowering import pack
from ._known_release import iteration_past_contacts, may_skip, with_releases
from ._layout import compiled_chunk, Horizon, Lanes, LaneStart, start_lanes
from ._table import Table


class Chunking(NamedTuple):
    """Chunk sizes of a batch run; only the maximum number of attempts affects
    results.
    """

    width: int
    """Number of batch elements that run at a time."""
    rows: int
    """Number of attempts in a chunk, after which ended batch elements are replaced."""
    max_steps: int
    """Maximum number of attempts of one batch element."""


def run_refilled(
    lanes: Lanes, horizon: Horizon, settings, chunking: Chunking, table: Table
):
    """Run the batch elements; each one that ends is replaced by the next.

    Elements are independent, so their order and grouping do not change any result. The
    logs of all batch elements are stored in the `table`.

    Returns:
        Impacts, attempts and result codes, each `(elements,)`.
    """
    start = start_lanes(lanes, horizon, settings, chunking.width)
    if settings.compiles:
        step, compiled_start = iteration, start
        if may_skip(start):
            step, compiled_start = iteration_past_contacts, with_releases(start)
        try:
            return run_compiled(
                compiled_start,
                chunking.max_steps,
                table,
                on_gpu=settings.on_gpu,
                step=step,
            )
        except Lacking as lacking:
            say_lacking(lacking, settings.demands)
    return _by_xla(start, chunking, table)


def run_compiled(
    start: LaneStart,
    max_steps: int,
    table: Table,
    *,
    on_gpu: bool = False,
    step: Callable = iteration,
    between: Callable[[], None] | None = None,
):
    """Run the loop as LLVM code, which replaces ended batch elements itself.

    `step` takes one attempted step; `between` is called at intervals.

    **Raises:** `Lacking` if the backend lacks an operation.
    """
    count = start.numbers.shape[1]
    shared, shared_layout = laid_out(start.shared)
    own, own_layout = laid_out(start.own, count)
    numbers = np.ascontiguousarray(start.numbers.T)
    layouts = own_layout, shared_layout, start.slots.example()
    width = 1 if on_gpu else vector_width()
    key = key_of(start.static, *layouts, table.row, width, step)
    loop = cuda_attempts_of(key) if on_gpu else attempts_of(key)
    loop.run(
        shared,
        own,
        numbers,
        table.numbers,
        first=table.first,
        limit=max_steps,
        between=between,
    )
    place = loop_state(start.slots.rows)
    columns = [place.impacts, place.steps, place.status]
    return tuple(numbers[:, columns].astype(int).T)


def _by_xla(start: LaneStart, chunking: Chunking, table: Table):
    """Run chunks of attempts in all positions, which are refilled between chunks."""
    count, (width, rows, max_steps) = start.numbers.shape[1], chunking
    packed_own, packed_shared = pack(start.own, count), pack(start.shared)
    chunk = compiled_chunk(start, packed_own, packed_shared, rows, table.row)
    place = start.slots.rows
    ends = np.zeros((count, 3), dtype=int)
    # the first batch elements are spread evenly, to predict the cost of the others;
    # positions without an element of their own hold the last one and are not run
    first = np.linspace(0, count - 1, min(width, count)).astype(int)
    work, used = np.full(width, count - 1), np.zeros(width)
    work[: len(first)], running = first, np.arange(width) < count
    waiting, sorted_yet = np.setdiff1d(np.arange(count), first), False
    shared = jnp.asarray(packed_shared.numbers), packed_shared.apart
    numbers, mine = start.numbers[:, work], packed_own.some(work)
    numbers[place.status, ~running] = FINISHED
    while np.any(running):
        numbers, log = chunk(mine, shared, numbers)
        table.take(work, log)
        used += rows
        status = np.asarray(numbers)[place.status]
        over = running & ((status != RUNNING) | (used >= max_steps))
        if not np.any(over):
            continue
        numbers = np.array(numbers)
        counted = [place.status, place.impacts, place.steps]
        ends[work[over]] = numbers[counted].T[over]
        # an element that has used up its attempts is marked, so that it does not change
        numbers[place.status, over], running[over] = FINISHED, False
        if not sorted_yet:
            waiting = costly_first(waiting, work, used, numbers[place.stops])
            sorted_yet = True
        free = np.flatnonzero(over)[: len(waiting)]
        fresh, waiting = waiting[: len(free)], waiting[len(free) :]
        work[free], used[free], running[free] = fresh, 0, True
        numbers[:, free] = start.numbers[:, fresh]
        mine = packed_own.some(work)
    return ends[:, 1], ends[:, 2], ends[:, 0]


def costly_first(waiting, work, used, stops):
    """Sort the waiting batch elements by expected number of attempts, the largest
    first.

    An element that needs many attempts and starts last leaves the other positions idle.
    Neighbouring elements have similar costs, so the attempts per period of those that
    are running predict the costs of the others.
    """
    order = np.argsort(work, kind="stable")
    each = used[order] / np.maximum(stops[order], 0.5)
    expected = np.interp(waiting, work[order], each)
    return waiting[np.argsort(-expected, kind="stable")]
