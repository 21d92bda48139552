"""Apply a compiled function to many batch elements."""

import ctypes
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import llvmlite.ir as ir
import numpy as np
from jax.interpreters import partial_eval

from ._elementwise import converted
from ._emit import Emitter
from ._machine import compiled, vector_width
from ._writer import DOUBLE, INT64, Place, Writer


_FLOAT = np.dtype(np.float64)
_NAME = "map"


class _Traced(NamedTuple):
    jaxpr: Any
    consts: list
    shared: int
    own: int


def _traced(function, shared: int, own: int) -> _Traced:
    shapes = [jax.ShapeDtypeStruct((k,), jnp.float64) for k in (shared, own)]
    closed = jax.make_jaxpr(lambda *parts: [jnp.asarray(v) for v in function(*parts)])(
        *shapes
    )
    wanted = [True] * len(closed.jaxpr.outvars)
    pruned, _ = partial_eval.dce_jaxpr(closed.jaxpr, wanted, instantiate=True)
    return _Traced(pruned, closed.consts, shared, own)


def _module_of(traced: _Traced, width: int) -> ir.Module:
    module = ir.Module(_NAME)
    pointer = DOUBLE.as_pointer()
    kind = ir.FunctionType(ir.VoidType(), [pointer, pointer, pointer, INT64])
    function = ir.Function(module, kind, _NAME)
    for argument in function.args[:3]:
        argument.add_attribute("noalias")
    shared, own, made, count = function.args
    b = ir.IRBuilder(function.append_basic_block("entry"))
    writer = Writer(module, b, width)

    def number(k):
        return ir.Constant(INT64, k)

    numbers = np.empty(traced.shared, dtype=object)
    numbers[:] = [b.load(b.gep(shared, [number(k)])) for k in range(traced.shared)]
    writer.remember(numbers, Place(shared, 0))
    before, block = b.block, b.append_basic_block("block")
    b.branch(block)
    b.position_at_end(block)
    first = b.phi(INT64)
    first.add_incoming(number(0), before)

    def column(array, k):
        """Return the address of the next `width` values of row k of an array."""
        place = b.gep(array, [b.add(b.mul(number(k), count), first)])
        return b.bitcast(place, writer.vector(DOUBLE).as_pointer())

    mine = np.empty(traced.own, dtype=object)
    mine[:] = [b.load(column(own, k), align=8) for k in range(traced.own)]
    writer.remember(mine, Place(own, 0, count, first))
    results = Emitter(writer).program(traced.jaxpr, traced.consts, [numbers, mine])
    for k, (element, v) in enumerate(zip(results, traced.jaxpr.outvars, strict=True)):
        value = element[()]
        if isinstance(value, ir.Value):
            value = converted(writer, value, v.aval.dtype, _FLOAT)
        else:
            value = writer.number(float(value), _FLOAT)
        b.store(writer.spread(value), column(made, k), align=8)
    more = b.add(first, number(width))
    after = b.append_basic_block("after")
    first.add_incoming(more, b.block)
    b.cbranch(b.icmp_signed("<", more, count), block, after)
    b.position_at_end(after)
    b.ret_void()
    return module


class Mapped:
    """A function of `(shared, own)` that returns scalars, compiled for many `own`.

    **Arguments:** a function of two arrays of 64-bit floats, and their sizes.

    **Raises:** `Lacking` with the name of an operation that the backend does not have.
    """

    def __init__(self, function, shared: int, own: int, width: int | None = None):
        self.width = vector_width() if width is None else width
        traced = _traced(function, shared, own)
        self.results = len(traced.jaxpr.outvars)
        pointers = [ctypes.c_void_p] * 3
        text = str(_module_of(traced, self.width))
        self._function = compiled(text, _NAME, None, [*pointers, ctypes.c_int64])

    def __call__(self, shared, own) -> np.ndarray:
        """Return the results as 64-bit floats, `(count, results)`, for `own` `(count,
        k)`.
        """
        count = len(own)
        if not count:
            return np.empty((0, self.results))
        whole = -(-count // self.width) * self.width
        # padded with the last element, because a function may be undefined at zero
        rows = np.minimum(np.arange(whole), count - 1)
        columns = np.ascontiguousarray(np.asarray(own, dtype=float)[rows].T)
        shared = np.ascontiguousarray(shared, dtype=float)
        made = np.empty((self.results, whole))
        pointers = [a.ctypes.data for a in (shared, columns, made)]
        self._function(*pointers, whole)
        return np.ascontiguousarray(made[:, :count].T)
