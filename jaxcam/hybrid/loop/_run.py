"""Run the event loop as a batched while loop, or as a scan that can be transposed."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..codes import RowKind, RUNNING
from ..lowering import depend_on, one_kernel, with_kept
from ._advance import Plan
from ._functions import Functions
from ._iterate import iteration, Record
from ._loop_state import LoopState


# number of iterations between two checks for running batch elements, and between two
# writes to the log, which are costly under vmap
_BLOCK = 16


class Log(NamedTuple):
    """One row per iteration; rows of kind `RowKind.NOTHING` are failed attempts."""

    kind: Float[Array, " rows"]
    constraint: Float[Array, " rows"]
    t: Float[Array, " rows"]
    before: Float[Array, "rows n"]
    after: Float[Array, "rows n"]
    mode: Float[Array, "rows flags"]


Company = Literal["one", "few"]
"""Number of batch elements that run together: one without `vmap`, or a few."""


def run(
    functions: Functions,
    plan: Plan,
    carried: LoopState,
    rows: int,
    company: Company = "few",
) -> tuple[LoopState, Log]:
    """Iterate until the run has finished or the log is full.

    This supports forward mode only. Under `vmap`, all batch elements share the
    iterations, so one row of the log is written for all of them at once.
    """
    carried, log = run_raw(functions, plan, carried, rows, _row, company)
    return carried, log_of(log, functions.n)


def run_raw(
    functions: Functions,
    plan: Plan,
    carried: LoopState,
    rows: int,
    row,
    company: Company = "few",
):
    """Run the loop and log the scalars `row(record, state)` of each attempt.

    `company` tells for how many batch elements the loop is compiled.
    """
    carried = jax.tree.map(jnp.asarray, carried)

    def body(carried):
        carried, record = iteration(functions, plan, carried)
        return carried, jnp.stack(row(record, carried))

    # in a single run, no scalar is computed twice, so keeping scalars in memory would
    # only increase the compilation time
    alone = company == "one"
    keeping, kept = with_kept(body, carried, on=not (functions.plain or alone))
    width = len(row(_empty_record(carried), carried))
    blocks = -(-rows // _BLOCK)

    def unfinished(carry):
        count, (carried, _), _ = carry
        return (count < blocks) & eqxi.unvmap_any(carried.status == RUNNING)

    def several(carry):
        count, state, log = carry
        state, some = jax.lax.scan(lambda s, _: keeping(s), state, None, length=_BLOCK)
        start = (count * _BLOCK, jnp.zeros_like(count))
        return count + 1, state, jax.lax.dynamic_update_slice(log, some, start)

    def loop(state):
        # allocated here, because the kernel keeps its arguments in memory
        log = jnp.zeros((blocks * _BLOCK, width))
        start = (jnp.asarray(0, jnp.int32), state, log)
        _, last, log = jax.lax.while_loop(unfinished, several, start)
        return last, log

    last, log = one_kernel(loop, on=not functions.plain)((carried, kept))
    carried, kept = last
    return carried._replace(steps=depend_on(carried.steps, kept)), log


def attempts(functions: Functions, plan: Plan, carried: LoopState, row):
    """Run a block of attempts of one trajectory, to be mapped over many trajectories.

    Returns:
        The batch element, and for each number in `row` an array with one entry per
        attempt.
    """

    def body(carried):
        carried, record = iteration(functions, plan, carried)
        return carried, tuple(row(record, carried))

    keeping, kept = with_kept(body, carried, on=not functions.plain)
    start = carried, kept
    (carried, kept), log = jax.lax.scan(
        lambda state, _: keeping(state), start, None, length=_BLOCK
    )
    return carried._replace(steps=depend_on(carried.steps, kept)), log


def run_many(some: Callable, lanes: LoopState, rows: int, row):
    """Iterate until no batch element is running or the log is full.

    **Arguments:** `some(lanes)`, which runs `attempts` for all batch elements and
    returns them and the log, in which their axis is last; the batch elements,
    `(elements,)` each; the number of rows of the log; and `row`.

    Returns:
        The batch elements and the log, `(rows, elements)` for each number in a row.
    """
    # the log is written in its final layout, because under `vmap` each write would move
    # all of it
    blocks, width = -(-rows // _BLOCK), len(lanes.status)
    parts = row(_empty_record(lanes), lanes)
    log = [jnp.zeros((blocks * _BLOCK, width)) for _ in parts]

    def unfinished(carry):
        count, lanes, _ = carry
        return (count < blocks) & jnp.any(lanes.status == RUNNING)

    def several(carry):
        count, lanes, log = carry
        lanes, made = some(lanes)
        at = count * _BLOCK, jnp.zeros_like(count)
        log = [
            jax.lax.dynamic_update_slice(whole, part.astype(whole.dtype), at)
            for whole, part in zip(log, made, strict=True)
        ]
        return count + 1, lanes, log

    _, lanes, log = jax.lax.while_loop(
        unfinished, several, (jnp.asarray(0, jnp.int32), lanes, log)
    )
    return lanes, log


def run_reversible(
    functions: Functions, plan: Plan, carried: LoopState, rows: int
) -> tuple[LoopState, Log]:
    """Run a fixed number of `rows` iterations, for reverse-mode differentiation.

    Blocks of iterations are recomputed in the backward pass, so memory grows with the
    square root of their number.
    """
    block = max(1, int(rows**0.5))
    blocks = -(-rows // block)

    def one(carried, _):
        carried, record = iteration(functions, plan, carried)
        return carried, jnp.stack(_row(record, carried))

    @jax.checkpoint
    def many(carried, _):
        return jax.lax.scan(one, carried, None, length=block)

    carried, log = jax.lax.scan(many, carried, None, length=blocks)
    log = log.reshape(blocks * block, -1)
    return carried, log_of(log, functions.n)


def _empty_record(state: LoopState) -> Record:
    zero = 0.0
    x, flags = (zero,) * len(state.x), (zero,) * len(state.mode)
    points = tuple(jnp.asarray(False) for _ in state.points)
    return Record(zero, zero, zero, x, x, flags, points)


def _row(record: Record, _: LoopState) -> list:
    return numbers_of_row(record)


def numbers_of_row(record: Record) -> list:
    """Return the numbers of a row of the log."""
    flags = [jnp.asarray(c, dtype=jnp.float64) for c in record.mode]
    head = [record.kind, record.constraint, record.t]
    return [jnp.asarray(v) for v in head] + [*record.before, *record.after, *flags]


def log_of(log, n: int) -> Log:
    """Return the `Log` that rows of numbers contain, for states of `n` components."""
    return Log(
        kind=log[:, 0],
        constraint=log[:, 1],
        t=log[:, 2],
        before=log[:, 3 : 3 + n],
        after=log[:, 3 + n : 3 + 2 * n],
        mode=log[:, 3 + 2 * n :],
    )


def rows_of_kind(log: Log, *wanted: RowKind):
    """Return a mask of the rows whose kind is among those `wanted`."""
    mask = log.kind == float(wanted[0])
    for w in wanted[1:]:
        mask = mask | (log.kind == float(w))
    return mask
