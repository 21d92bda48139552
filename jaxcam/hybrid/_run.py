"""Running the loop: a batch-friendly while loop, or a scan that can be transposed."""

from collections.abc import Callable
from typing import Literal, NamedTuple

import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._advance import Plan
from ._codes import Row
from ._functions import Functions
from ._lane import Lane, RUNNING
from ._loop import iterate, Record
from ._materialise import depend_on, with_kept
from ._one_kernel import one_kernel


# iterations between two looks at whether any lane still runs, and between two writes to
# the log, which under vmap are costly
_BLOCK = 16


class Log(NamedTuple):
    """One row an iteration; rows of kind `Row.NOTHING` are failed attempts."""

    kind: Float[Array, " rows"]
    constraint: Float[Array, " rows"]
    t: Float[Array, " rows"]
    before: Float[Array, "rows n"]
    after: Float[Array, "rows n"]
    contact: Float[Array, "rows m"]


#: how many lanes `vmap` will run together: no `vmap` at all, or a few
Company = Literal["one", "few"]


def run(
    functions: Functions, plan: Plan, lane: Lane, rows: int, company: Company = "few"
) -> tuple[Lane, Log]:
    """Iterate until the lane has finished or the log is full.

    Forward mode only. Under `vmap` the iterations are shared by all lanes, so that one
    row of the log is written for all of them at once.
    """
    lane, log = run_raw(functions, plan, lane, rows, _row, company)
    return lane, _unpack(log, functions)


def run_raw(
    functions: Functions,
    plan: Plan,
    lane: Lane,
    rows: int,
    row,
    company: Company = "few",
):
    """`run` with a log of what `row(record, lane)` makes of each attempt: scalars.

    It is compiled in the way that is best in this `company`.
    """
    lane = jax.tree.map(jnp.asarray, lane)

    def body(lane):
        lane, record = iterate(functions, plan, lane)
        return lane, jnp.stack(row(record, lane))

    # scalars of one lane are never computed twice, and to keep them costs compile time
    keeping, kept = (_as_it_is(body), []) if company == "one" else with_kept(body, lane)
    width = len(row(_empty_record(functions.n, functions.m), lane))
    blocks = -(-rows // _BLOCK)
    log = jnp.zeros((blocks * _BLOCK, width))

    def unfinished(carry):
        count, (lane, _), _ = carry
        return (count < blocks) & eqxi.unvmap_any(lane.status == RUNNING)

    def several(carry):
        count, state, log = carry
        state, some = jax.lax.scan(lambda s, _: keeping(s), state, None, length=_BLOCK)
        start = (count * _BLOCK, jnp.zeros_like(count))
        return count + 1, state, jax.lax.dynamic_update_slice(log, some, start)

    start = (jnp.asarray(0, jnp.int32), (lane, kept), log)
    loop = one_kernel(lambda start: jax.lax.while_loop(unfinished, several, start))
    _, last, log = loop(start)
    lane, kept = last
    return lane._replace(steps=depend_on(lane.steps, kept)), log


def attempts(functions: Functions, plan: Plan, lane: Lane, row):
    """A block of attempts of one lane, to be mapped over many.

    **Returns:** the lane, and of each number in `row` an array, one for each attempt.
    """

    def body(lane):
        lane, record = iterate(functions, plan, lane)
        return lane, tuple(row(record, lane))

    keeping, kept = with_kept(body, lane)
    start = lane, kept
    (lane, kept), log = jax.lax.scan(
        lambda state, _: keeping(state), start, None, length=_BLOCK
    )
    return lane._replace(steps=depend_on(lane.steps, kept)), log


def run_many(some: Callable, lanes: Lane, rows: int, row):
    """Iterate until no lane runs or the log is full.

    **Arguments:** `some(lanes)`, the `attempts` of all lanes with the lanes last in the
    log; the lanes, `(lanes,)` each; the rows of the log, and `row`.

    **Returns:** the lanes and the log, `(rows, lanes)` for each number in a row.
    """
    # the log is written as it will lie: under `vmap` each write would move all of it
    blocks, width = -(-rows // _BLOCK), len(lanes.status)
    parts = row(_empty_record(len(lanes.x), len(lanes.jets)), lanes)
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


def _as_it_is(body):
    def whole(state):
        lane, row = body(state[0])
        return (lane, []), row

    return whole


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
        return lane, jnp.stack(_row(record, lane))

    @jax.checkpoint
    def many(lane, _):
        return jax.lax.scan(one, lane, None, length=block)

    lane, log = jax.lax.scan(many, lane, None, length=blocks)
    return lane, _unpack(log.reshape(blocks * block, -1), functions)


def _empty_record(n: int, m: int) -> Record:
    zero = 0.0
    state = (zero,) * n
    return Record(zero, zero, zero, state, state, (zero,) * m)


def _row(record: Record, _: Lane) -> list:
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
