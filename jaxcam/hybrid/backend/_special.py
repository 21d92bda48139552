"""Vectorised exponentials, logarithms and remainders; other functions from the C
library.

The formulas are those of fdlibm (Sun Microsystems, 1993) without branches: errors are
below 1 ulp. A function of the C library is called once per batch element; its error is
usually also below 1 ulp.
"""

from typing import Any

import llvmlite.ir as ir

from ._writer import DOUBLE, FAST, INT64, Writer


# ln 2 in two parts, the first of 32 bits
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10
_LOG2_E = 1.44269504088896338700
_EXP = (
    1.66666666666666019037e-01,
    -2.77777777770155933842e-03,
    6.61375632143793436117e-05,
    -1.65339022054652515390e-06,
    4.13813679705723846039e-08,
)
_LOG = (
    6.666666666666735130e-01,
    3.999999999940941908e-01,
    2.857142874366239149e-01,
    2.222219843214978396e-01,
    1.818357216161805012e-01,
    1.531383769920937332e-01,
    1.479819860511658591e-01,
)
# operations computed by the C library
LIBRARY = frozenset(
    """
    acos acosh asin asinh atan atan2 atanh cbrt cos cosh erf erfc expm1 lgamma log1p
    nextafter pow sin sinh tan tanh
    """.split()
)


class Arithmetic:
    """Short names for arithmetic on LLVM values of one shape and on Python numbers."""

    def __init__(self, writer: Writer):
        self.w = writer
        self.b: Any = writer.builder

    def _two(self, a, b):
        if not isinstance(a, ir.Value):
            a = self.w.like(b, a)
        if not isinstance(b, ir.Value):
            b = self.w.like(a, b)
        return self.w.alike([a, b])

    def add(self, a, b):
        return self.b.fadd(*self._two(a, b), flags=FAST)

    def sub(self, a, b):
        return self.b.fsub(*self._two(a, b), flags=FAST)

    def mul(self, a, b):
        return self.b.fmul(*self._two(a, b), flags=FAST)

    def div(self, a, b):
        return self.b.fdiv(*self._two(a, b))

    def horner(self, coefficients, z):
        total = self.w.like(z, coefficients[-1])
        for c in coefficients[-2::-1]:
            total = self.add(self.mul(total, z), c)
        return total

    def polynomial(self, coefficients, z):
        """Return a polynomial with few sequential operations."""
        terms = list(coefficients)
        while len(terms) > 1:
            pairs = [terms[i : i + 2] for i in range(0, len(terms), 2)]
            terms = [
                self.add(self.mul(pair[1], z), pair[0]) if len(pair) > 1 else pair[0]
                for pair in pairs
            ]
            z = self.mul(z, z)
        return terms[0]

    def less(self, a, b):
        return self.b.fcmp_ordered("<", *self._two(a, b))

    def equal(self, a, b):
        return self.b.fcmp_ordered("==", *self._two(a, b))

    def is_nan(self, a):
        return self.b.fcmp_unordered("uno", a, a)

    def choose(self, flag, a, b):
        a, b = self._two(a, b)
        return self.b.select(flag, a, b)

    def bits(self, a):
        return self.b.bitcast(a, self.w.with_kind(a, INT64))

    def from_bits(self, a):
        return self.b.bitcast(a, self.w.with_kind(a, DOUBLE))


def exp(writer: Writer, x):
    """Return e^x of 64-bit floats with an error below 1 ulp."""
    a = Arithmetic(writer)
    # beyond these limits the result is infinite or zero; NaN is preserved
    x = a.choose(a.less(x, -750.0), -750.0, x)
    x = a.choose(a.less(710.0, x), 710.0, x)
    turns = writer.call("llvm.rint", [a.mul(x, _LOG2_E)])
    high = a.sub(x, a.mul(turns, _LN2_HIGH))
    return _scaled_exp(a, high, a.mul(turns, _LN2_LOW), turns)


def exp2(writer: Writer, x):
    """Return 2^x of 64-bit floats with an error below 1 ulp."""
    a = Arithmetic(writer)
    x = a.choose(a.less(x, -1080.0), -1080.0, x)
    x = a.choose(a.less(1025.0, x), 1025.0, x)
    turns = writer.call("llvm.rint", [x])
    rest = a.sub(x, turns)
    high = a.b.fmul(rest, writer.like(rest, 0.6931471805599453))
    # rounding errors of this product and of ln 2 itself
    wrong = writer.call(
        "llvm.fma", [rest, writer.like(rest, 0.6931471805599453), a.b.fneg(high)]
    )
    low = a.add(wrong, a.mul(rest, 2.3190468138462996e-17))
    return _scaled_exp(a, high, a.b.fneg(low), turns)


def _scaled_exp(a: Arithmetic, high, low, turns):
    """Return e^(high - low) 2^turns for |high| <= ln 2 / 2."""
    r = a.sub(high, low)
    z = a.mul(r, r)
    c = a.sub(r, a.mul(z, a.horner(_EXP, z)))
    bend = a.div(a.mul(r, c), a.sub(2.0, c))
    y = a.sub(1.0, a.sub(a.sub(low, bend), high))
    # multiply by 2^turns in two factors, each of which is representable as a float
    whole = a.b.fptosi(turns, a.w.with_kind(turns, INT64))
    # for NaN, the converted number of turns would be arbitrary
    whole = a.b.select(a.is_nan(turns), a.w.like(whole, 0), whole)
    half = a.b.ashr(whole, a.w.like(whole, 1))
    for part in (half, a.b.sub(whole, half)):
        exponent = a.b.add(part, a.w.like(part, 1023))
        y = a.b.fmul(y, a.from_bits(a.b.shl(exponent, a.w.like(part, 52))))
    return y


def log(writer: Writer, x):
    """Return the natural logarithm of 64-bit floats with an error below 1 ulp."""
    a = Arithmetic(writer)
    small = a.less(x, 2.2250738585072014e-308)
    y = a.choose(small, a.b.fmul(x, writer.like(x, 2.0**54)), x)
    bits = a.bits(y)
    # the exponent of y / sqrt(1/2)
    shifted = a.b.sub(bits, writer.like(bits, 0x3FE6A09E667F3BCD))
    turns = a.b.ashr(shifted, writer.like(bits, 52))
    mantissa = a.b.sub(bits, a.b.shl(turns, writer.like(bits, 52)))
    f = a.b.fsub(a.from_bits(mantissa), writer.like(x, 1.0))
    k = a.b.sitofp(turns, x.type)
    k = a.choose(small, a.b.fsub(k, writer.like(x, 54.0)), k)
    s = a.div(f, a.add(f, 2.0))
    z = a.mul(s, s)
    rest = a.mul(z, a.horner(_LOG, z))
    half = a.mul(a.mul(f, 0.5), f)
    low = a.add(a.mul(s, a.add(half, rest)), a.mul(k, _LN2_LOW))
    made = a.sub(a.mul(k, _LN2_HIGH), a.sub(a.sub(half, low), f))
    made = a.choose(a.equal(x, float("inf")), x, made)
    made = a.choose(a.equal(x, 0.0), float("-inf"), made)
    # the logarithm of a negative number, or of NaN, is NaN
    fine = a.b.fcmp_ordered(">=", x, writer.like(x, 0.0))
    return a.choose(fine, made, float("nan"))


def remainder(writer: Writer, x, y):
    """Return the exact remainder of x divided by y, with the sign of x."""
    name = f"remainder.{writer.width if isinstance(x.type, ir.VectorType) else 1}"
    known = writer.module.globals.get(name)
    if known is None:
        known = _write_remainder(writer, name, x.type)
    return writer.builder.call(known, [x, y])


def _write_remainder(writer: Writer, name: str, kind):
    function = ir.Function(writer.module, ir.FunctionType(kind, [kind, kind]), name)
    function.linkage = "internal"
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    count = kind.count if isinstance(kind, ir.VectorType) else 1
    w = Writer(writer.module, builder, count)
    a = Arithmetic(w)
    x, y = function.args
    size, step = w.call("llvm.fabs", [x]), w.call("llvm.fabs", [y])
    ratio = w.call("llvm.trunc", [builder.fdiv(size, step)])
    # the product and the difference are exact, because a float can represent the
    # remainder for up to 2^53 steps
    rest = w.call("llvm.fma", [builder.fneg(ratio), step, size])
    rest = a.choose(a.less(rest, 0.0), builder.fadd(rest, step), rest)
    rest = a.choose(a.less(size, step), size, rest)
    fine = w.both(a.less(ratio, 2.0**52), a.less(size, float("inf")))
    made = w.call("llvm.copysign", [rest, x])
    odd = w.any(builder.not_(fine))
    by_library = builder.append_basic_block("by_library")
    done = builder.append_basic_block("done")
    here = builder.block
    builder.cbranch(odd, by_library, done)
    builder.position_at_end(by_library)
    exact = _each(w, "fmod", [x, y])
    builder.branch(done)
    builder.position_at_end(done)
    result = builder.phi(kind)
    result.add_incoming(made, here)
    result.add_incoming(exact, by_library)
    builder.ret(result)
    return function


def library(writer: Writer, name: str, arguments):
    """Call a function of the C library for each batch element."""
    arguments = writer.alike(arguments)
    if not isinstance(arguments[0].type, ir.VectorType):
        return _each(writer, name, arguments)
    full = f"{name}.each"
    function = writer.module.globals.get(full)
    if function is None:
        kinds = [a.type for a in arguments]
        function = ir.Function(writer.module, ir.FunctionType(kinds[0], kinds), full)
        function.linkage = "internal"
        function.attributes.add("noinline")
        builder = ir.IRBuilder(function.append_basic_block("entry"))
        inner = Writer(writer.module, builder, writer.width)
        builder.ret(_each(inner, name, list(function.args)))
    return writer.builder.call(function, arguments)


def _each(writer: Writer, name: str, arguments):
    function = writer.declare(name, ir.FunctionType(DOUBLE, [DOUBLE] * len(arguments)))
    for attribute in ("nounwind", "readnone"):
        function.attributes.add(attribute)
    kind = arguments[0].type
    if not isinstance(kind, ir.VectorType):
        return writer.builder.call(function, arguments)
    made = ir.Constant(kind, ir.Undefined)
    for i in range(kind.count):
        place = ir.Constant(ir.IntType(32), i)
        one = [writer.builder.extract_element(a, place) for a in arguments]
        made = writer.builder.insert_element(
            made, writer.builder.call(function, one), place
        )
    return made
