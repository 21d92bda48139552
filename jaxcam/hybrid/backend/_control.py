"""Branches and loops inside a program, for batch elements that take different paths.

Each side of a branch that at least one element of the vector takes is computed, and one
of them is selected; a loop continues until it has ended for all elements. In a side
that is active for only some batch elements, loops do not wait for the others.
"""

import functools
from collections.abc import Callable
from typing import no_type_check

import llvmlite.ir as ir
import numpy as np

from ..lowering import is_known
from ._arrays import value_of
from ._writer import INT64, kind_of, Lacking, Writer


# maximum number of operations of a side of a branch that is not skipped
_SHORT = 24
# maximum number of operations of an unrolled loop
_UNROLLED = 6000
# maximum number of values that a table of a loop may store on the stack
_KEPT = 16384


@no_type_check
def branches(w: Writer, program: Callable, size: Callable, equation, inputs):
    """Emit the sides of a branch, and select one of them by an index.

    A side that no element of the vector takes is skipped, unless it is short.
    """
    which, *arguments = inputs
    sides = equation.params["branches"]
    dtype = equation.invars[0].aval.dtype
    if is_known(which[()]):
        side = sides[int(np.clip(which[()], 0, len(sides) - 1))]
        return program(side.jaxpr, side.consts, arguments)
    index, outer, made = which[()], w.mask, None
    for k, side in enumerate(sides):
        here = _is_side(w, index, k, len(sides), dtype)
        w.mask = w.both(outer, here)
        skipped = size(side.jaxpr) > _SHORT
        emit = functools.partial(program, side.jaxpr, side.consts, arguments)
        results = _where_taken(w, emit, side.out_avals) if skipped else emit()
        made = results if made is None else _chosen(w, side, here, results, made)
    w.mask = outer
    return made


@no_type_check
def _where_taken(w: Writer, emit: Callable, avals):
    """Emit instructions that are skipped if the mask contains no element."""
    b, before = w.builder, w.builder.block
    inside, after = b.append_basic_block("side"), b.append_basic_block("after")
    b.cbranch(w.any(w.mask), inside, after)
    b.position_at_end(inside)
    carried = _Carried(w, avals)
    flat = carried.flat(emit())
    end = b.block
    b.branch(after)
    b.position_at_end(after)
    unused = [ir.Constant(value.type, ir.Undefined) for value in flat]
    made = carried.enter(unused, before)
    carried.add(flat, end)
    return made


@no_type_check
def _is_side(w: Writer, index, k: int, number: int, dtype):
    """Return whether the index selects this side; indices out of range select the first
    or the last.
    """
    if dtype == np.bool_:
        return index if k else w.builder.not_(index)
    sign = "<=" if k == 0 else ">=" if k == number - 1 else "=="
    return w.builder.icmp_signed(sign, index, w.like(index, k))


@no_type_check
def _chosen(w: Writer, side, here, results, others):
    made = []
    for aval, new, old in zip(side.out_avals, results, others, strict=True):
        out = np.empty(new.shape, dtype=object)
        pairs = zip(new.ravel(), old.ravel(), strict=True)
        out.ravel()[:] = [
            w.choose(here, value_of(w, a, aval.dtype), value_of(w, b, aval.dtype))
            for a, b in pairs
        ]
        made.append(out)
    return made


class _Carried:
    """The values that pass from one block of instructions to another, as vectors."""

    def __init__(self, w: Writer, avals):
        self.w, self.avals = w, avals
        self.shapes = [aval.shape for aval in avals]
        self.nodes: list = []

    def flat(self, arrays) -> list:
        pairs = zip(arrays, self.avals, strict=True)
        return [
            self.w.spread(value_of(self.w, element, aval.dtype))
            for array, aval in pairs
            for element in array.ravel()
        ]

    def enter(self, flat, before) -> list:
        """Create the values at the head of a block, and return them as arrays.

        **Arguments:** the values with which the block is entered from `before`.
        """
        for value in flat:
            node = self.w.builder.phi(value.type)
            node.add_incoming(value, before)
            self.nodes.append(node)
        return self.arrays(self.nodes)

    def arrays(self, flat) -> list:
        out, left = [], list(flat)
        for shape in self.shapes:
            size = int(np.prod(shape))
            array = np.empty(size, dtype=object)
            array[:] = left[:size]
            out.append(array.reshape(shape))
            left = left[size:]
        return out

    def add(self, flat, block) -> None:
        """Add the values with which the block is entered from another one."""
        for node, value in zip(self.nodes, flat, strict=True):
            node.add_incoming(value, block)


@no_type_check
def while_loop(w: Writer, program: Callable, equation, inputs):
    """Emit a loop that runs until all elements have ended; ended ones do not change."""
    params, b = equation.params, w.builder
    first, second = params["cond_nconsts"], params["body_nconsts"]
    of_test, of_body = inputs[:first], inputs[first : first + second]
    test, body = params["cond_jaxpr"], params["body_jaxpr"]
    carried = _Carried(w, body.out_avals)
    begun = carried.flat(inputs[first + second :])
    before, head = b.block, b.append_basic_block("while")
    inside, after = b.append_basic_block("round"), b.append_basic_block("after")
    b.branch(head)
    b.position_at_end(head)
    state = carried.enter(begun, before)
    (goes,) = program(test.jaxpr, test.consts, [*of_test, *state])
    goes = w.both(w.mask, w.spread(value_of(w, goes[()], np.dtype(bool))))
    b.cbranch(w.any(goes), inside, after)
    b.position_at_end(inside)
    outer, w.mask = w.mask, goes
    new = program(body.jaxpr, body.consts, [*of_body, *state])
    w.mask = outer
    pairs = zip(carried.flat(new), carried.nodes, strict=True)
    chosen = [w.choose(goes, value, old) for value, old in pairs]
    carried.add(chosen, b.block)
    b.branch(head)
    b.position_at_end(after)
    return state


@no_type_check
def scan(w: Writer, program: Callable, size: Callable, equation, inputs):
    """Emit a loop of a known number of rounds, unrolled if it is short."""
    params = equation.params
    number, length = params["num_carry"], params["length"]
    fixed, rest = inputs[: params["num_consts"]], inputs[params["num_consts"] :]
    start, given = rest[:number], rest[number:]
    body = params["jaxpr"]
    order = range(length)[::-1] if params["reverse"] else range(length)
    if length * size(body.jaxpr) <= _UNROLLED:
        rows = [None] * length
        for k in order:
            made = program(body.jaxpr, body.consts, [*fixed, *start, *_row(given, k)])
            start, rows[k] = made[:number], made[number:]
        avals = body.out_avals[number:]
        return [*start, *(_stacked(rows, i, a) for i, a in enumerate(avals))]
    return _rolled(w, program, body, (fixed, start, given), length, params["reverse"])


def _row(arrays, k: int) -> list:
    out = []
    for array in arrays:
        row = np.empty(array.shape[1:], dtype=object)
        row[...] = array[k]
        out.append(row)
    return out


def _stacked(rows, i: int, aval):
    out = np.empty((len(rows), *aval.shape), dtype=object)
    for k, row in enumerate(rows):
        out[k] = row[i] if aval.shape else row[i][()]
    return out


@no_type_check
def _rolled(w: Writer, program: Callable, body, parts, length: int, reverse: bool):
    fixed, start, given = parts
    b, number = w.builder, len(start)
    tables = [
        _Table(w, aval.dtype, array)
        for aval, array in zip(body.in_avals[len(fixed) + number :], given, strict=True)
    ]
    made = [
        _Table(w, aval.dtype, None, (length, *aval.shape))
        for aval in body.out_avals[number:]
    ]
    carried = _Carried(w, body.out_avals[:number])
    begun = carried.flat(start)
    before, head = b.block, b.append_basic_block("scan")
    b.branch(head)
    b.position_at_end(head)
    count = b.phi(INT64)
    count.add_incoming(ir.Constant(INT64, 0), before)
    state = carried.enter(begun, before)
    last = ir.Constant(INT64, length - 1)
    k = b.sub(last, count) if reverse else count
    results = program(
        body.jaxpr, body.consts, [*fixed, *state, *(t.row(k) for t in tables)]
    )
    for table, row in zip(made, results[number:], strict=True):
        table.write(k, row)
    flat = carried.flat(results[:number])
    more = b.add(count, ir.Constant(INT64, 1))
    here, after = b.block, b.append_basic_block("after")
    count.add_incoming(more, here)
    carried.add(flat, here)
    b.cbranch(b.icmp_signed("<", count, last), head, after)
    b.position_at_end(after)
    return [*carried.arrays(flat), *(t.all() for t in made)]


class _Table:
    """Rows of values on the stack, accessed by an unknown index."""

    def __init__(self, w: Writer, dtype, array, shape=None):
        self.w, self.dtype = w, dtype
        self.shape = array.shape if shape is None else shape
        self.size = int(np.prod(self.shape[1:]))
        kind = kind_of(dtype)
        # a flag is stored as a byte
        self.kind = w.vector(ir.IntType(8) if kind == ir.IntType(1) else kind)
        if self.shape[0] * self.size > _KEPT:
            raise Lacking(f"scan over {self.shape[0]} rows of {self.size}")
        self.room = w.memory(self.kind, max(1, self.shape[0] * self.size))
        if array is not None:
            for i, element in enumerate(array.ravel()):
                self._store(ir.Constant(INT64, i), element)

    def _store(self, place, element):
        value = self.w.spread(value_of(self.w, element, self.dtype))
        if self.dtype == np.bool_:
            value = self.w.builder.zext(value, self.kind)
        self.w.builder.store(value, self.w.builder.gep(self.room, [place]))

    def _load(self, place):
        value = self.w.builder.load(self.w.builder.gep(self.room, [place]))
        if self.dtype == np.bool_:
            value = self.w.builder.trunc(value, self.w.vector(ir.IntType(1)))
        return value

    def _place(self, k, i: int):
        base = self.w.builder.mul(k, ir.Constant(INT64, self.size))
        return self.w.builder.add(base, ir.Constant(INT64, i))

    def row(self, k) -> np.ndarray:
        out = np.empty(self.size, dtype=object)
        out[:] = [self._load(self._place(k, i)) for i in range(self.size)]
        return out.reshape(self.shape[1:])

    def write(self, k, row) -> None:
        for i, element in enumerate(row.ravel()):
            self._store(self._place(k, i), element)

    def all(self) -> np.ndarray:
        number = int(np.prod(self.shape))
        out = np.empty(number, dtype=object)
        out[:] = [self._load(ir.Constant(INT64, i)) for i in range(number)]
        return out.reshape(self.shape)
