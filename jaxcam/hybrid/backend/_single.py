"""Exponentials and logarithms of 32-bit floats, by polynomials in 64-bit arithmetic.

The polynomials are minimax fits: their relative errors, 4e-9 (logarithm) and 3e-9
(power of two), are small fractions of the 6e-8 of a 32-bit float. There is no division,
and few operations depend on each other, because the length of each step waits for them.
"""

from ._special import Arithmetic
from ._writer import DOUBLE, INT64, Writer


_LN2 = 0.6931471805599453
# log2(1 + f) / f for sqrt(1/2) <= 1 + f < sqrt(2)
_LOG2 = (
    1.4426950408299197,
    -0.721347351499036,
    0.4808982410609812,
    -0.3606966495759399,
    0.2885674083874084,
    -0.23961739917841482,
    0.20460061555627407,
    -0.19106278878202176,
    0.1861750105021869,
    -0.10994953058923133,
)
# 2^f for |f| <= 1/2
_EXP2 = (
    1.0,
    0.6931472057374776,
    0.2402264689060157,
    0.05550328776506919,
    0.00961848895904135,
    0.001339993140457213,
    0.00015345811914273602,
)
# the upper half of sqrt(1/2): numbers from here to sqrt(2) have the exponent zero
_ROOT_HALF = 0x3FE6A09E << 32


def log_of_single(writer: Writer, x):
    """Return the logarithm of a 32-bit float, given and returned as a 64-bit float."""
    a = Arithmetic(writer)
    bits = a.bits(x)
    power = a.b.ashr(
        a.b.sub(bits, writer.like(bits, _ROOT_HALF)), writer.like(bits, 52)
    )
    mantissa = a.b.sub(bits, a.b.shl(power, writer.like(bits, 52)))
    f = a.sub(a.from_bits(mantissa), 1.0)
    k = a.b.sitofp(power, x.type)
    made = a.mul(a.add(k, a.mul(f, a.polynomial(_LOG2, f))), _LN2)
    made = a.choose(a.equal(x, float("inf")), x, made)
    made = a.choose(a.equal(x, 0.0), float("-inf"), made)
    fine = a.b.fcmp_ordered(">=", x, writer.like(x, 0.0))
    return a.choose(fine, made, float("nan"))


def exp_of_single(writer: Writer, x):
    """Return e^x of a 32-bit float, given and returned as a 64-bit float."""
    a = Arithmetic(writer)
    return exp2_of_single(writer, a.mul(x, 1 / _LN2))


def exp2_of_single(writer: Writer, x):
    """Return 2^x of a 32-bit float, given and returned as a 64-bit float."""
    a = Arithmetic(writer)
    # beyond these limits the result is zero or infinite as a 32-bit float
    x = a.choose(a.less(x, -200.0), -200.0, x)
    x = a.choose(a.less(200.0, x), 200.0, x)
    power = writer.call("llvm.rint", [x])
    made = a.polynomial(_EXP2, a.sub(x, power))
    whole = a.b.fptosi(power, writer.with_kind(power, INT64))
    exponent = a.b.shl(whole, writer.like(whole, 52))
    scaled = a.b.bitcast(a.b.add(a.bits(made), exponent), writer.with_kind(x, DOUBLE))
    return a.choose(a.is_nan(x), x, scaled)


# operations of 32-bit floats that are computed here
SINGLE = {"exp": exp_of_single, "exp2": exp2_of_single, "log": log_of_single}
