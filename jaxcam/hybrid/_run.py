"""Running the loop: a batch-friendly while loop, or a scan that can be transposed."""

from typing import NamedTuple

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jax.custom_batching import custom_vmap
from jaxtyping import Array, Float

from ._codes import Row
from ._functions import Functions
from ._lane import RUNNING, Lane
from ._loop import Plan, Record, iterate
from ._materialise import depend_on, while_loop


class Log(NamedTuple):
    """One row an iteration; rows of kind `Row.NOTHING` are failed attempts."""

    kind: Float[Array, " rows"]
    constraint: Float[Array, " rows"]
    t: Float[Array, " rows"]
    before: Float[Array, "rows n"]
    after: Float[Array, "rows n"]
    contact: Float[Array, "rows m"]


def run(functions: Functions, plan: Plan, lane: Lane, rows: int) -> tuple[Lane, Log]:
    """Iterate until the lane has finished or the log is full.

    Forward mode only. Under `vmap` the iterations are shared by all lanes, so that one
    row of the log is written for all of them at once.
    """
    lane, log = run_raw(functions, plan, lane, rows, _row)
    return lane, _unpack(log, functions)


def run_raw(functions: Functions, plan: Plan, lane: Lane, rows: int, row):
    """`run` with a log of what `row` makes of each record: a list of scalars."""
    width = len(row(_empty_record(functions)))
    log = jnp.zeros((rows, width))

    def unfinished(carry):
        count, lane, _ = carry
        return (count < rows) & eqxi.unvmap_any(lane.status == RUNNING)

    def body(carry):
        count, lane, log = carry
        lane, record = iterate(functions, plan, lane)
        return count + 1, lane, _write(log, jnp.stack(row(record)), count)

    start = (jnp.asarray(0, jnp.int32), lane, log)
    (_, lane, log), witness = while_loop(unfinished, body, start)
    return lane._replace(steps=depend_on(lane.steps, witness)), log


def run_reversible(
    functions: Functions, plan: Plan, lane: Lane, rows: int
) -> tuple[Lane, Log]:
    """The same, always for `rows` iterations, for reverse-mode differentiation.

    Blocks of iterations are recomputed on the way back, so that memory grows with the
    square root of their number.
    """
    block = max(1, int(rows**0.5))
    blocks = -(-rows // block)

    def one(lane, _):
        lane, record = iterate(functions, plan, lane)
        return lane, jnp.stack(_row(record))

    @jax.checkpoint
    def many(lane, _):
        return jax.lax.scan(one, lane, None, length=block)

    lane, log = jax.lax.scan(many, lane, None, length=blocks)
    return lane, _unpack(log.reshape(blocks * block, -1), functions)


@custom_vmap
def _write(log, row, count):
    return jax.lax.dynamic_update_slice(log, row[None], (count, jnp.zeros_like(count)))


@_write.def_vmap
def _write_batch(size, in_batched, log, row, count):
    """All lanes write the same row: one contiguous update, not a scatter."""
    log_batched, row_batched, count_batched = in_batched
    if count_batched:
        raise NotImplementedError("lanes of one batch share their iteration count")
    if not log_batched:
        log = jnp.broadcast_to(log, (size, *log.shape))
    if not row_batched:
        row = jnp.broadcast_to(row, (size, *row.shape))
    zero = jnp.zeros_like(count)
    start = (zero, count, zero)
    return jax.lax.dynamic_update_slice(log, row[:, None], start), True


def _empty_record(functions: Functions) -> Record:
    zero = 0.0
    state = (zero,) * functions.n
    return Record(zero, zero, zero, state, state, (zero,) * functions.m)


def _row(record: Record) -> list:
    flags = [jnp.asarray(c, dtype=jnp.float64) for c in record.contact]
    head = [record.kind, record.constraint, record.t]
    return [jnp.asarray(v) for v in head] + [*record.before, *record.after, *flags]


def _unpack(log, functions: Functions) -> Log:
    n, m = functions.n, functions.m
    return Log(
        kind=log[:, 0],
        constraint=log[:, 1],
        t=log[:, 2],
        before=log[:, 3 : 3 + n],
        after=log[:, 3 + n : 3 + 2 * n],
        contact=log[:, 3 + 2 * n : 3 + 2 * n + m],
    )


def kinds(log: Log, *wanted: Row):
    """Which rows are of one of the kinds."""
    mask = log.kind == float(wanted[0])
    for w in wanted[1:]:
        mask = mask | (log.kind == float(w))
    return mask
