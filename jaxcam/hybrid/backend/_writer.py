"""Emit instructions for one batch element, or for a vector of them.

A value that is the same for all batch elements stays a scalar, so that the compiler
moves computations with such values out of the loop.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import llvmlite.ir as ir
import numpy as np

from ..caches import Cache


# a product and a sum may be fused without intermediate rounding, as in XLA
FAST = ("contract",)

DOUBLE = ir.DoubleType()
BIT, BYTE = ir.IntType(1), ir.IntType(8)
INT32, INT64 = ir.IntType(32), ir.IntType(64)
_KINDS = {
    "float64": DOUBLE,
    "float32": ir.FloatType(),
    "bool": BIT,
    **{f"{s}int{n}": ir.IntType(n) for n in (8, 16, 32, 64) for s in ("", "u")},
}


class Lacking(Exception):
    """Raised, with the name of the operation, if the backend lacks an operation."""


@functools.cache
def kind_of(dtype) -> Any:
    """Return the LLVM type of a scalar."""
    if str(dtype) not in _KINDS:
        raise Lacking(f"numbers of type {dtype}")
    return _KINDS[str(dtype)]


def compiled_or_lacking(cache: Cache, key, make: Callable):
    """Return the result of `make`, which is called only once for each key.

    **Raises:** `Lacking`, even if tracing or compiling fails for another reason: XLA
    then runs the program, or reports the error in it.
    """

    def attempt():
        try:
            return make()
        except Lacking as lacking:
            return str(lacking)
        except Exception as error:
            return f"a program that ends in {type(error).__name__}: {error}"

    try:
        found = cache.get(key, attempt)
    except TypeError:
        found = attempt()
    if isinstance(found, str):
        raise Lacking(found)
    return found


def is_float(dtype) -> bool:
    return np.issubdtype(dtype, np.floating)


class Place(NamedTuple):
    """Where a value was loaded from: row `index` of an array in memory."""

    pointer: Any
    index: int
    # distance between two rows, and first batch element; `None` if the array is shared
    # by all batch elements
    stride: Any = None
    first: Any = None


class Writer:
    """Emits instructions into one function; `width` batch elements fit into a
    vector.
    """

    def __init__(self, module: ir.Module, builder: ir.IRBuilder, width: int):
        self.module, self.builder, self.width = module, builder, width
        # in branches and loops: the batch elements for which the result is used
        self.mask: Any = None
        # where loaded values are in memory, keyed by the `id` of each value
        self.places: dict[int, Place] = {}
        # number of values that lookups have stored on the stack
        self.stored = 0
        # tables of known numbers, keyed by their type and content
        self.constants: dict[tuple[str, bytes], ir.GlobalVariable] = {}

    def remember(self, values, first: Place) -> None:
        """Remember that values were loaded from consecutive rows of an array."""
        for k, value in enumerate(values):
            self.places[id(value)] = first._replace(index=first.index + k)

    def vector(self, kind):
        """Return the type of a value that differs between batch elements."""
        return kind if self.width == 1 else ir.VectorType(kind, self.width)

    def number(self, value, dtype):
        """Return a known number as a constant."""
        kind = kind_of(dtype)
        if isinstance(kind, ir.IntType):
            bits = int(value) & (2**kind.width - 1)
            return ir.Constant(kind, bits)
        return ir.Constant(kind, float(np.dtype(dtype).type(value)))

    def spread(self, value):
        """Return a vector that contains the value for every batch element."""
        kind = value.type
        if self.width == 1 or isinstance(kind, ir.VectorType):
            return value
        if isinstance(value, ir.Constant):
            return ir.Constant(self.vector(kind), [value] * self.width)
        empty = ir.Constant(self.vector(kind), ir.Undefined)
        one = self.builder.insert_element(empty, value, ir.Constant(INT32, 0))
        order = ir.Constant(ir.VectorType(INT32, self.width), [0] * self.width)
        return self.builder.shuffle_vector(one, empty, order)

    def alike(self, values) -> list:
        """Return all values as vectors, if one of them is a vector."""
        if any(isinstance(v.type, ir.VectorType) for v in values):
            return [self.spread(v) for v in values]
        return list(values)

    def like(self, value, number):
        """Return a Python number as a constant of the type of a value."""
        kind = value.type
        if isinstance(kind, ir.VectorType):
            return ir.Constant(kind, [ir.Constant(kind.element, number)] * kind.count)
        return ir.Constant(kind, number)

    def with_kind(self, value, kind):
        """Return the type with the given scalar type and the shape of the value."""
        if isinstance(value.type, ir.VectorType):
            return ir.VectorType(kind, value.type.count)
        return kind

    def call(self, name: str, arguments, result=None, suffixes=None):
        """Call an LLVM intrinsic, whose full name ends with the type of its operand."""
        result = arguments[0].type if result is None else result
        full = name + "".join(
            "." + _suffix(kind) for kind in (suffixes or [arguments[0].type])
        )
        kinds = [a.type for a in arguments]
        function = self.declare(full, ir.FunctionType(result, kinds))
        return self.builder.call(function, arguments)

    def declare(self, name: str, kind: ir.FunctionType):
        known = self.module.globals.get(name)
        return ir.Function(self.module, kind, name) if known is None else known

    def any(self, flags):
        """Return, as a scalar, whether a flag is set for any batch element."""
        if not isinstance(flags.type, ir.VectorType):
            return flags
        bits = ir.IntType(flags.type.count)
        set_bits = self.builder.bitcast(flags, bits)
        return self.builder.icmp_unsigned("!=", set_bits, ir.Constant(bits, 0))

    def both(self, a, b):
        """Return a flag that is set where both are; `None` is set for all elements."""
        if a is None or b is None:
            return b if a is None else a
        return self.builder.and_(*self.alike([a, b]))

    def choose(self, flag, when_true, when_false):
        """Select between values; the flag may be a scalar."""
        if isinstance(flag.type, ir.VectorType):
            when_true, when_false = self.spread(when_true), self.spread(when_false)
        else:
            when_true, when_false = self.alike([when_true, when_false])
        return self.builder.select(flag, when_true, when_false)

    def memory(self, kind, count: int):
        """Allocate `count` values on the stack."""
        with self.builder.goto_entry_block():
            return self.builder.alloca(kind, ir.Constant(INT64, count))


def _suffix(kind) -> str:
    if isinstance(kind, ir.VectorType):
        return f"v{kind.count}{_suffix(kind.element)}"
    if isinstance(kind, ir.IntType):
        return f"i{kind.width}"
    return "f64" if isinstance(kind, ir.DoubleType) else "f32"
