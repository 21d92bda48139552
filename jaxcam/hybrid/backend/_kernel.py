"""The loop around an attempt, for a vector of batch elements replaced one by one.

The values of the active batch elements are in slots, with one row per value and one
column per slot. Each round loads them, performs one attempt and stores the results.
Rare operations (writing a row of the log, replacing an ended batch element) are done
slot by slot in separate loops. On a CPU, one call works on all slots; there are as many
slots as a register holds values. On a GPU, each thread works on one slot, and all
threads take batch elements from one queue.
"""

import contextlib
from typing import Any, NamedTuple, no_type_check

import llvmlite.ir as ir
import numpy as np

from ..codes import RUNNING
from ._arrays import element, elements
from ._elementwise import converted
from ._emit import Emitter
from ._ptx import thread
from ._writer import DOUBLE, INT64, Place, Writer


# name of the function in each module
ENTRY = "run"
# numbers that the calls (or threads) share: index of the next batch element, number of
# rounds so far, and number of calls that returned before their batch elements had ended
QUEUE, ROUNDS, UNFINISHED = COUNTERS = range(3)
_POINTER = DOUBLE.as_pointer()
_COUNTS = INT64.as_pointer()
_FLOAT = np.dtype(np.float64)


class Program(NamedTuple):
    """One attempt: a jaxpr whose inputs are shared values, own values and the state.

    The first two are arrays, the state is given as scalars. The results are the scalars
    of the new state, the index of a row of the log (negative if there is none), and
    that row.
    """

    jaxpr: Any
    consts: list
    # types of the scalars of the state, and the indices of the status and attempt
    # counter
    dtypes: tuple
    status: int
    steps: int
    shared: int
    own: int
    # number of values in a row of the log
    row: int


class _Arguments(NamedTuple):
    shared: Any
    own: Any
    lanes: Any
    slots: Any
    work: Any
    order: Any
    # `COUNTERS`
    counters: Any
    log: Any
    queued: Any
    places: Any
    first: Any
    limit: Any
    patience: Any


_KINDS = (
    [_POINTER] * 4 + [_COUNTS] * 3 + [_POINTER, INT64, INT64, DOUBLE, DOUBLE, INT64]
)


def module_of(program: Program, width: int, threads: bool = False) -> ir.Module:
    """Return a module with the function `ENTRY`, for vectors of `width` batch elements,
    or for the threads of a GPU.
    """
    module = ir.Module("attempts")
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), _KINDS), ENTRY)
    for argument in function.args:
        if isinstance(argument.type, ir.PointerType):
            argument.add_attribute("noalias")
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    w = Writer(module, builder, width)
    slots = _Slots(ir.Constant(INT64, 0), ir.Constant(INT64, width))
    if threads:
        function.calling_convention = "ptx_kernel"
        slots = _Slots(*thread(w))
    _Kernel(program, w, _Arguments(*function.args), slots).write()
    return module


class _Slots(NamedTuple):
    """The first slot of a call, and the number of slots of all calls."""

    first: Any
    number: Any


@no_type_check
class _Kernel:
    def __init__(self, program, writer: Writer, arguments: _Arguments, slots: _Slots):
        self.p, self.w, self.b, self.a = program, writer, writer.builder, arguments
        self.slots = slots
        self.states = len(program.dtypes)
        self.shared: list = []

    def write(self) -> None:
        b = self.b
        blocks = ("refill", "attempt", "log", "over", "ended", "done")
        refill, attempt, log, over, ended, done = map(b.append_basic_block, blocks)
        row = self.w.memory(self.w.vector(DOUBLE), max(1, self.p.row))
        self.shared = [
            self._load(self.a.shared, self._int(k)) for k in range(self.p.shared)
        ]
        self.w.remember(self.shared, Place(self.a.shared, 0))
        start = b.block
        b.branch(refill)

        b.position_at_end(refill)
        count = b.phi(INT64)
        count.add_incoming(self._int(0), start)
        live: Any = self._refill()
        filled = b.block
        nothing = b.icmp_unsigned("==", live, ir.Constant(live.type, 0))
        b.cbranch(nothing, done, attempt)

        b.position_at_end(attempt)
        round_count = b.phi(INT64)
        round_count.add_incoming(count, filled)
        place = self._attempt(row)
        after = b.add(round_count, self._int(1))
        b.cbranch(self._any(self._logged(place)), log, over)

        b.position_at_end(log)
        self._log(row, place)
        b.branch(over)

        b.position_at_end(over)
        running = self._bits(self._runs())
        ends: Any = b.and_(live, b.not_(running))
        some = b.icmp_unsigned("!=", ends, ir.Constant(ends.type, 0))
        patient = b.icmp_signed("<", after, self.a.patience)
        b.cbranch(b.or_(some, b.not_(patient)), ended, attempt)
        round_count.add_incoming(after, over)

        b.position_at_end(ended)
        count.add_incoming(after, ended)
        b.cbranch(patient, refill, done)

        b.position_at_end(done)
        rest, rounds = b.phi(INT64), b.phi(INT64)
        rounds.add_incoming(count, filled)
        rounds.add_incoming(after, ended)
        rest.add_incoming(self._int(0), filled)
        rest.add_incoming(self._int(1), ended)
        self._count(ROUNDS, rounds)
        self._count(UNFINISHED, rest)
        b.ret_void()

    def _int(self, k: int):
        return ir.Constant(INT64, k)

    def _load(self, pointer, place):
        return self.b.load(self.b.gep(pointer, [place]))

    def _store(self, value, pointer, place) -> None:
        self.b.store(value, self.b.gep(pointer, [place]))

    def _count(self, which: int, number):
        """Emit code that adds to a counter, and return the previous value."""
        place = self.b.gep(self.a.counters, [self._int(which)])
        return self.b.atomic_rmw("add", place, number, "monotonic")

    @contextlib.contextmanager
    def _each(self, count):
        """Emit a loop over 0, 1, ..., `count` - 1; `count` must be positive."""
        b = self.b
        before, head = b.block, b.append_basic_block("each")
        b.branch(head)
        b.position_at_end(head)
        k = b.phi(INT64)
        k.add_incoming(self._int(0), before)
        yield k
        more = b.add(k, self._int(1))
        after = b.append_basic_block("next")
        k.add_incoming(more, b.block)
        b.cbranch(b.icmp_signed("<", more, count), head, after)
        b.position_at_end(after)

    def _column(self, row):
        """Return the address of one row of the slots of this call, as a vector."""
        place = self.b.gep(self.a.slots, [self._slot(self._int(row), self._int(0))])
        return self.b.bitcast(place, self.w.vector(DOUBLE).as_pointer())

    def _slot(self, row, k):
        """Return the index of one value of one slot of this call."""
        of_call = self.b.add(self.slots.first, k)
        return self.b.add(self.b.mul(row, self.slots.number), of_call)

    def _bits(self, flags):
        """Return flags as the bits of one number."""
        if not isinstance(flags.type, ir.VectorType):
            return flags
        return self.b.bitcast(flags, ir.IntType(self.w.width))

    def _any(self, bits):
        return self.b.icmp_unsigned("!=", bits, ir.Constant(bits.type, 0))

    def _copy(self, numbers: int, source, place, target, to) -> None:
        """Emit a loop that copies values; `place` and `to` map the index of a value to
        its places in `source` and `target`.
        """
        if not numbers:
            return
        with self._each(self._int(numbers)) as i:
            self._store(self._load(source, place(i)), target, to(i))

    def _refill(self) -> Any:
        """Emit code that stores ended batch elements and loads waiting ones; return the
        occupied slots as bits.
        """
        b, a = self.b, self.a
        with self._each(self._int(self.w.width)) as k:
            mine = b.add(self.slots.first, k)
            lane = self._load(a.work, mine)
            busy = b.icmp_signed(">=", lane, self._int(0))
            status = self._load(a.slots, self._slot(self._int(self.p.status), k))
            steps = self._load(a.slots, self._slot(self._int(self.p.steps), k))
            runs = self._going(status, steps)
            with b.if_then(b.and_(busy, b.not_(runs))):
                base = b.mul(lane, self._int(self.states))
                self._copy(
                    self.states,
                    a.slots,
                    lambda i: self._slot(i, k),
                    a.lanes,
                    lambda i: b.add(base, i),
                )
                self._store(self._int(-1), a.work, mine)
            lane = self._load(a.work, mine)
            with b.if_then(b.icmp_signed("<", lane, self._int(0))):
                at = self._count(QUEUE, self._int(1))
                with b.if_then(b.icmp_signed("<", at, a.queued)):
                    self._take(self._load(a.order, at), mine, k)
        work = b.bitcast(b.gep(a.work, [self.slots.first]), self._counts())
        lanes = b.load(work, align=8)
        return self._bits(b.icmp_signed(">=", lanes, self.w.like(lanes, 0)))

    def _counts(self):
        return self.w.vector(INT64).as_pointer()

    def _take(self, lane, mine, k) -> None:
        """Emit code that loads a waiting batch element into a slot."""
        b, a = self.b, self.a
        self._store(lane, a.work, mine)
        states = b.mul(lane, self._int(self.states))
        self._copy(
            self.states,
            a.lanes,
            lambda i: b.add(states, i),
            a.slots,
            lambda i: self._slot(i, k),
        )
        owned = b.mul(lane, self._int(self.p.own))
        self._copy(
            self.p.own,
            a.own,
            lambda i: b.add(owned, i),
            a.slots,
            lambda i: self._slot(b.add(i, self._int(self.states)), k),
        )

    def _going(self, status, steps):
        """Return whether batch elements with this status and number of attempts
        continue.
        """
        running = self.b.fcmp_ordered("==", status, self.w.like(status, RUNNING))
        limit = self.a.limit
        if isinstance(status.type, ir.VectorType):
            limit = self.w.spread(limit)
        return self.b.and_(running, self.b.fcmp_ordered("<", steps, limit))

    def _runs(self):
        status, steps = (
            self.b.load(self._column(row), align=8)
            for row in (self.p.status, self.p.steps)
        )
        return self._going(status, steps)

    def _attempt(self, row):
        """Emit one attempt in all slots; return the place of the log row of each
        slot.
        """
        b, p = self.b, self.p
        columns = [b.load(self._column(k), align=8) for k in range(self.states + p.own)]
        leaves = [
            element(converted(self.w, value, _FLOAT, dtype))
            for value, dtype in zip(columns, p.dtypes)
        ]
        own = columns[self.states :]
        across = self.slots.number, self.slots.first
        self.w.remember(own, Place(self.a.slots, self.states, *across))
        numbers = [elements(part) for part in (own, self.shared)]
        made = Emitter(self.w).program(p.jaxpr, p.consts, [*numbers, *leaves])
        dtypes = [v.aval.dtype for v in p.jaxpr.outvars]
        kept = [
            self._number(element[()], dtype)
            for element, dtype in zip(made, dtypes, strict=True)
        ]
        for k, value in enumerate(kept[: self.states]):
            b.store(value, self._column(k), align=8)
        for k, value in enumerate(kept[self.states + 1 :]):
            b.store(value, b.gep(row, [self._int(k)]))
        return kept[self.states]

    def _number(self, element, dtype):
        """Return an element of a result as a vector of floats."""
        if not isinstance(element, ir.Value):
            return self.w.spread(self.w.number(float(element), _FLOAT))
        return self.w.spread(converted(self.w, element, dtype, _FLOAT))

    def _logged(self, place):
        here = self.b.fcmp_ordered(">=", place, self.w.like(place, 0.0))
        return self._bits(here)

    def _log(self, row, place) -> None:
        """Emit code that copies the rows of all slots to their places in the log."""
        b, a, p = self.b, self.a, self.p
        places = self.w.memory(self.w.vector(DOUBLE), 1)
        b.store(place, places)
        numbers = b.bitcast(places, _POINTER)
        rows = b.bitcast(row, _POINTER)
        with self._each(self._int(self.w.width)) as k:
            at = b.fsub(self._load(numbers, k), a.first)
            lane = self._load(a.work, b.add(self.slots.first, k))
            last = b.sitofp(a.places, DOUBLE)
            fits = b.and_(
                b.fcmp_ordered(">=", at, ir.Constant(DOUBLE, 0.0)),
                b.fcmp_ordered("<", at, last),
            )
            with b.if_then(b.and_(fits, b.icmp_signed(">=", lane, self._int(0)))):
                index = b.add(b.mul(lane, a.places), b.fptosi(at, INT64))
                base = b.mul(index, self._int(p.row))
                self._copy(
                    p.row,
                    rows,
                    lambda i: b.add(b.mul(i, self._int(self.w.width)), k),
                    a.log,
                    lambda i: b.add(base, i),
                )
