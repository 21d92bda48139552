"""Elementwise operations of JAX, with XLA's conventions for NaN.

Each function takes the writer, the parameters of the operation, the JAX type of its
operands, and the operands, which are either all scalars or all vectors.
"""

from typing import no_type_check

import llvmlite.ir as ir
import numpy as np

from ._single import SINGLE
from ._special import (
    Arithmetic,
    exp,
    exp2,
    LIBRARY,
    library,
    log,
    remainder,
)
from ._writer import DOUBLE, FAST, is_float, kind_of, Lacking, Writer


_COMPARED = {"lt": "<", "le": "<=", "gt": ">", "ge": ">=", "eq": "==", "ne": "!="}
_ROUNDED = {"floor": "floor", "ceil": "ceil", "sqrt": "sqrt"}
_LOGICAL = {"and": "and_", "or": "or_", "xor": "xor"}
_SUMS = {"add": "add", "add_any": "add", "sub": "sub", "mul": "mul"}


@no_type_check
def elementwise(w: Writer, name: str, params, dtype, x):
    """Emit an elementwise operation, and return its result.

    **Raises:** `Lacking`, with the name of the operation.
    """
    b, real = w.builder, is_float(dtype)
    if name == "select_n":
        return _chosen(w, x)
    if name == "clamp":
        low, value, high = x
        return _extreme(w, "min", dtype, _extreme(w, "max", dtype, value, low), high)
    x = w.alike(x)
    if name in _SUMS:
        kind = _SUMS[name]
        return getattr(b, f"f{kind}")(*x, flags=FAST) if real else getattr(b, kind)(*x)
    if name in _COMPARED:
        return _comparison(w, _COMPARED[name], dtype, x)
    if name in _LOGICAL:
        return getattr(b, _LOGICAL[name])(*x)
    if name == "not":
        return b.not_(x[0])
    if name in ("max", "min"):
        return _extreme(w, name, dtype, *x)
    if name in ("lt_to", "le_to"):
        return _ordered(w, "<" if name == "lt_to" else "<=", dtype, x)
    if name == "convert_element_type":
        return converted(w, x[0], dtype, params["new_dtype"])
    if name == "integer_pow":
        return _power(w, x[0], params["y"], dtype)
    if name == "square":
        return elementwise(w, "mul", {}, dtype, [x[0], x[0]])
    if name == "sign":
        return _sign(w, x[0], dtype)
    if not real:
        return _of_integers(w, name, dtype, x)
    if name == "div":
        return b.fdiv(*x)
    if name == "neg":
        return b.fneg(x[0])
    if name == "abs":
        return w.call("llvm.fabs", x)
    if name in _ROUNDED:
        return w.call(f"llvm.{_ROUNDED[name]}", x)
    if name == "round":
        even = int(params["rounding_method"]) == 1
        return w.call("llvm.roundeven" if even else "llvm.round", x)
    if name == "is_finite":
        size = w.call("llvm.fabs", x)
        return b.fcmp_ordered("<", size, w.like(size, float("inf")))
    if name == "rsqrt":
        return b.fdiv(w.like(x[0], 1.0), w.call("llvm.sqrt", x))
    return _of_doubles(w, name, dtype, x)


def _of_doubles(w: Writer, name: str, dtype, x):
    """Emit a function of 64-bit floats; other floats are converted before and after."""
    b, kind = w.builder, x[0].type
    narrow = str(dtype) == "float32"
    if narrow:
        x = [b.fpext(v, w.with_kind(v, DOUBLE)) for v in x]
    a = Arithmetic(w)
    if narrow and name in SINGLE:
        made = SINGLE[name](w, x[0])
    elif name == "exp":
        made = exp(w, x[0])
    elif name == "exp2":
        made = exp2(w, x[0])
    elif name == "log":
        made = log(w, x[0])
    elif name == "logistic":
        made = a.div(1.0, a.add(exp(w, b.fneg(x[0])), 1.0))
    elif name == "rem":
        made = remainder(w, *x)
    elif name in LIBRARY and not (narrow and name == "nextafter"):
        made = library(w, name, x)
    else:
        raise Lacking(name)
    return b.fptrunc(made, kind) if narrow else made


@no_type_check
def _chosen(w: Writer, x):
    which, *cases = x
    if _bits(which) == 1:
        return w.choose(which, cases[1], cases[0])
    made = cases[0]
    for k, case in enumerate(cases[1:], start=1):
        here = w.builder.icmp_signed("==", which, w.like(which, k))
        made = w.choose(here, case, made)
    return made


def _bits(value) -> int:
    return getattr(value.type, "element", value.type).width


@no_type_check
def _comparison(w: Writer, sign: str, dtype, x):
    if not is_float(dtype):
        signed = np.issubdtype(dtype, np.signedinteger)
        compare = w.builder.icmp_signed if signed else w.builder.icmp_unsigned
        return compare(sign, *x)
    if sign == "!=":
        return w.builder.fcmp_unordered(sign, *x)
    return w.builder.fcmp_ordered(sign, *x)


@no_type_check
def _ordered(w: Writer, sign: str, dtype, x):
    """Return a comparison in the total order of floats, which includes NaN."""
    if not is_float(dtype):
        return _comparison(w, sign, dtype, x)
    b, size = w.builder, kind_of(dtype)
    bits = 64 if size == DOUBLE else 32
    whole = ir.IntType(bits)
    placed = []
    for value in x:
        number = b.bitcast(value, w.with_kind(value, whole))
        negative = b.ashr(number, w.like(number, bits - 1))
        most = w.like(number, 2 ** (bits - 1) - 1)
        placed.append(b.xor(number, b.and_(negative, most)))
    return b.icmp_signed(sign, *placed)


@no_type_check
def _extreme(w: Writer, name: str, dtype, left, right):
    """Return the larger or the smaller operand; NaN if either is NaN."""
    b, sign = w.builder, ">" if name == "max" else "<"
    left, right = w.alike([left, right])
    if not is_float(dtype):
        return b.select(_comparison(w, sign, dtype, [left, right]), left, right)
    # a comparison with NaN is false and selects the second operand
    if isinstance(left, ir.Constant):
        return b.select(b.fcmp_ordered(sign, left, right), left, right)
    made = b.select(b.fcmp_ordered(sign, right, left), right, left)
    if isinstance(right, ir.Constant):
        return made
    return b.select(b.fcmp_unordered("uno", right, right), right, made)


@no_type_check
def _sign(w: Writer, x, dtype):
    b = w.builder
    if is_float(dtype):
        one = w.call("llvm.copysign", [w.like(x, 1.0), x])
        # preserve the sign of zero, and NaN
        moves = b.fcmp_ordered("!=", x, w.like(x, 0.0))
        return b.select(moves, one, x)
    zero = w.like(x, 0)
    if not np.issubdtype(dtype, np.signedinteger):
        return b.select(b.icmp_unsigned("!=", x, zero), w.like(x, 1), zero)
    negative = b.select(b.icmp_signed("<", x, zero), w.like(x, -1), zero)
    return b.select(b.icmp_signed(">", x, zero), w.like(x, 1), negative)


@no_type_check
def _power(w: Writer, x, exponent: int, dtype):
    """Compute an integer power by squaring, in the order of JAX."""
    one = 1.0 if is_float(dtype) else 1
    if exponent == 0:
        return w.like(x, one)
    size, made = abs(exponent), None
    while size:
        if size & 1:
            made = x if made is None else elementwise(w, "mul", {}, dtype, [made, x])
        size >>= 1
        if size:
            x = elementwise(w, "mul", {}, dtype, [x, x])
    return w.builder.fdiv(w.like(made, one), made) if exponent < 0 else made


@no_type_check
def _of_integers(w: Writer, name: str, dtype, x):
    b, signed = w.builder, np.issubdtype(dtype, np.signedinteger)
    if name == "neg":
        return b.neg(x[0])
    if name == "abs":
        if not signed:
            return x[0]
        negative = b.icmp_signed("<", x[0], w.like(x[0], 0))
        return b.select(negative, b.neg(x[0]), x[0])
    if name in ("div", "rem"):
        return _quotient(w, name, signed, x)
    if name.startswith("shift_"):
        bits = w.like(x[1], kind_of(dtype).width - 1)
        far = b.icmp_unsigned(">", x[1], bits)
        if name == "shift_right_arithmetic":
            return b.ashr(x[0], b.select(far, bits, x[1]))
        shift = b.shl if name == "shift_left" else b.lshr
        zero = w.like(x[0], 0)
        return b.select(far, zero, shift(x[0], b.select(far, zero, x[1])))
    raise Lacking(name)


@no_type_check
def _quotient(w: Writer, name: str, signed: bool, x):
    """Return the quotient or the remainder of integers. Division by zero gives the
    quotient -1, and the dividend as the remainder; the smallest number divided by -1
    gives itself and the remainder 0.
    """
    b, (over, under) = w.builder, x
    zero, one, least = w.like(under, 0), w.like(under, 1), w.like(under, -1)
    odd = b.icmp_signed("==", under, zero)
    wraps = None
    if signed:
        smallest = w.like(over, -(2 ** (_bits(over) - 1)))
        wraps = b.and_(
            b.icmp_signed("==", under, least), b.icmp_signed("==", over, smallest)
        )
    safe = b.select(odd if wraps is None else b.or_(odd, wraps), one, under)
    if name == "div":
        made = (b.sdiv if signed else b.udiv)(over, safe)
        return b.select(odd, least, made)
    made = (b.srem if signed else b.urem)(over, safe)
    return b.select(odd, over, made)


@no_type_check
def converted(w: Writer, x, old, new):
    """Convert a number to another type, saturated if it is out of range."""
    if old == new:
        return x
    b, kind = w.builder, w.with_kind(x, kind_of(new))
    signed = np.issubdtype(new, np.signedinteger)
    if is_float(old):
        if new == np.bool_:
            return b.fcmp_unordered("!=", x, w.like(x, 0.0))
        if not is_float(new):
            name = "llvm.fptosi.sat" if signed else "llvm.fptoui.sat"
            return w.call(name, [x], kind, [kind, x.type])
        return b.fptrunc(x, kind) if str(new) == "float32" else b.fpext(x, kind)
    from_signed = np.issubdtype(old, np.signedinteger)
    if is_float(new):
        return b.sitofp(x, kind) if from_signed else b.uitofp(x, kind)
    if new == np.bool_:
        return b.icmp_signed("!=", x, w.like(x, 0))
    if old != np.bool_ and kind_of(new).width == kind_of(old).width:
        return x
    if old != np.bool_ and kind_of(new).width < kind_of(old).width:
        return b.trunc(x, kind)
    return b.sext(x, kind) if from_signed else b.zext(x, kind)


# the binary operation of each reduction
REDUCED = {
    "reduce_sum": "add",
    "reduce_prod": "mul",
    "reduce_max": "max",
    "reduce_min": "min",
    "reduce_and": "and",
    "reduce_or": "or",
    "reduce_xor": "xor",
}
# the binary operation of each cumulative reduction
RUNNING = {"cumsum": "add", "cumprod": "mul", "cummax": "max", "cummin": "min"}
# elementwise operations
ELEMENTWISE: frozenset[str] = (
    frozenset(
        """
    abs add add_any and ceil clamp convert_element_type div eq exp exp2 floor ge gt
    integer_pow is_finite le le_to log logistic lt lt_to max min mul ne neg not
    or rem round rsqrt select_n shift_left shift_right_arithmetic
    shift_right_logical sign sqrt square sub xor
    """.split()
    )
    | LIBRARY
)
