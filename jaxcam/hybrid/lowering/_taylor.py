"""Taylor series of a program of scalars along the motion that it defines.

A program whose first result is the vector field determines the Taylor series of the
motion: its coefficient of order k is the coefficient of order k - 1 of the field,
divided by k. Here, each scalar is replaced by its series, whose coefficients follow
from those of the operands by recurrences. Nested derivatives would compute the same
coefficients several times. (A. Griewank, A. Walther, Evaluating Derivatives, 2nd ed.,
SIAM 2008, chapter 13)
"""

import math
from collections.abc import Callable
from typing import no_type_check

import jax
import jax.numpy as jnp
import numpy as np

from ._known import is_known


_ZERO = np.float64(0.0)


class Series:
    """A scalar as a function of time: the coefficients of its powers."""

    def __init__(self, coefficients):
        self.coefficients = tuple(coefficients)

    @property
    def dtype(self):
        """Return the type of the numbers."""
        return np.result_type(self.coefficients[0])


def coefficient(element, order: int):
    """Return one coefficient of a series; a plain scalar is a constant series."""
    if not isinstance(element, Series):
        return element if order == 0 else _ZERO
    known = element.coefficients
    return known[order] if order < len(known) else _ZERO


def has_series(elements) -> bool:
    """Return whether any of the elements is a series."""
    return any(isinstance(e, Series) for e in elements)


# called for every scalar; see `_jaxprs.py`
@no_type_check
def in_series(name: str, params, elements, apply: Callable):
    """Return the result of an operation on series; None if there is no recurrence.

    **Arguments:** the name and parameters of a primitive, its operands, and
    `apply(name, *scalars)`, which applies a primitive to scalars, with `params` if it
    is the primitive with this `name`.
    """
    order = max(len(e.coefficients) for e in elements if isinstance(e, Series)) - 1
    parts = [[coefficient(e, k) for k in range(order + 1)] for e in elements]
    rule = _RULES.get(name)
    if rule is not None:
        return Series(rule(apply, order, *parts))
    if name in _CONSTANT:
        return apply(name, *(p[0] for p in parts))
    if name == "select_n":
        which = parts[0][0]
        return Series(
            apply(name, which, *(p[k] for p in parts[1:])) for k in range(order + 1)
        )
    if name == "integer_pow":
        exponent = params["y"]
        power = _power(apply, order, parts[0], abs(exponent))
        if exponent < 0:
            power = _div(apply, order, [np.float64(1.0), *[_ZERO] * order], power)
        return Series(power)
    if name == "convert_element_type":
        if not jnp.issubdtype(params["new_dtype"], jnp.floating):
            return apply(name, parts[0][0])
        return Series(
            part if is_known(part) else apply(name, part) for part in parts[0]
        )
    return None


# operations whose results are piecewise constant
_CONSTANT = frozenset(
    "and ceil eq floor ge gt is_finite le lt ne not or round sign xor".split()
)


def _sum(apply, terms):
    total = _ZERO
    for term in terms:
        total = apply("add", total, term)
    return total


def _product(apply, a, b, k: int, first: int = 0, last: int | None = None):
    """Return the sum of a_i b_(k-i) for i from `first` to `last`."""
    last = k if last is None else last
    return _sum(apply, [apply("mul", a[i], b[k - i]) for i in range(first, last + 1)])


def _add(apply, order, a, b):
    return [apply("add", a[k], b[k]) for k in range(order + 1)]


def _sub(apply, order, a, b):
    return [_difference(apply, a[k], b[k]) for k in range(order + 1)]


def _difference(apply, a, b):
    if is_known(a) and a == 0.0:
        return _negative(apply, b)
    return apply("sub", a, b)


def _negative(apply, a):
    return -a if is_known(a) else apply("neg", a)


def _neg(apply, order, a):
    return [_negative(apply, a[k]) for k in range(order + 1)]


def _mul(apply, order, a, b):
    return [_product(apply, a, b, k) for k in range(order + 1)]


def _square(apply, order, a):
    return _mul(apply, order, a, a)


def _power(apply, order, a, exponent: int):
    if exponent == 0:
        return [np.float64(1.0), *[_ZERO] * order]
    found = a
    for _ in range(exponent - 1):
        found = _mul(apply, order, found, a)
    return found


def _div(apply, order, a, b):
    # the quotient q follows from q b = a
    found = [apply("div", a[0], b[0])]
    if order == 0:
        return found
    inverse = apply("div", np.float64(1.0), b[0])
    for k in range(1, order + 1):
        known = _product(apply, found, b, k, last=k - 1)
        rest = _difference(apply, a[k], known)
        found.append(apply("mul", rest, inverse))
    return found


def _sqrt(apply, order, a):
    # the root r follows from r r = a
    found = [apply("sqrt", a[0])]
    if order == 0:
        return found
    inverse = apply("div", np.float64(0.5), found[0])
    for k in range(1, order + 1):
        known = _product(apply, found, found, k, 1, k - 1)
        found.append(apply("mul", _difference(apply, a[k], known), inverse))
    return found


def _max(apply, order, a, b):
    return _one_of(apply, order, apply("ge", a[0], b[0]), a, b)


def _min(apply, order, a, b):
    return _one_of(apply, order, apply("ge", b[0], a[0]), a, b)


def _one_of(apply, order, first, a, b):
    return [apply("select_n", first, b[k], a[k]) for k in range(order + 1)]


def _abs(apply, order, a):
    slope = apply("sign", a[0])
    return [apply("abs", a[0]), *(apply("mul", slope, c) for c in a[1:])]


def _slopes(apply, order, a):
    """Return the coefficients of a series, each multiplied by its index."""
    return [_ZERO] + [apply("mul", a[k], np.float64(k)) for k in range(1, order + 1)]


def _sincos(apply, order, a):
    rates = _slopes(apply, order, a)
    sines, cosines = [apply("sin", a[0])], [apply("cos", a[0])]
    for k in range(1, order + 1):
        share = np.float64(1 / k)
        up = _product(apply, rates, cosines, k, 1)
        down = _product(apply, rates, sines, k, 1)
        sines.append(apply("mul", up, share))
        cosines.append(apply("mul", _negative(apply, down), share))
    return sines, cosines


def _sin(apply, order, a):
    return _sincos(apply, order, a)[0]


def _cos(apply, order, a):
    return _sincos(apply, order, a)[1]


def _tan(apply, order, a):
    return _div(apply, order, *_sincos(apply, order, a))


_RULES = {
    "add": _add,
    "add_any": _add,
    "sub": _sub,
    "neg": _neg,
    "abs": _abs,
    "mul": _mul,
    "square": _square,
    "div": _div,
    "sqrt": _sqrt,
    "sin": _sin,
    "cos": _cos,
    "tan": _tan,
    "max": _max,
    "min": _min,
}


def by_nested_derivatives(function: Callable, order: int) -> Callable:
    """Return a function that computes the coefficients of the results of a `function`.

    The new function returns a list of results for each order; those that are not real
    numbers are constant. For each argument, it takes a list of `order + 1` arrays, the
    coefficients of its series; or, for a constant argument, one array.
    """

    def coefficients(*arguments):
        def at(time):
            values = []
            for argument in arguments:
                if not isinstance(argument, list):
                    values.append(argument)
                    continue
                value = argument[-1]
                for part in argument[-2::-1]:
                    value = part + time * value
                values.append(value)
            made = function(*values)
            whole = [v for v in made if not jnp.issubdtype(v.dtype, jnp.floating)]
            return ([v for v in made if jnp.issubdtype(v.dtype, jnp.floating)],), whole

        def one_more(below):
            def series(time):
                one = (jnp.ones_like(time),)
                made, rates, whole = jax.jvp(below, (time,), one, has_aux=True)
                return (*made, rates[-1]), whole

            return series

        series = at
        for _ in range(order):
            series = one_more(series)
        made, whole = series(jnp.zeros(()))
        found = []
        for k, part in enumerate(made):
            numbers, fixed = iter(part), iter(whole)
            shapes = jax.eval_shape(function, *(_first(a) for a in arguments))
            found.append(
                [
                    next(numbers) / math.factorial(k)
                    if jnp.issubdtype(v.dtype, jnp.floating)
                    else next(fixed)
                    for v in shapes
                ]
            )
        return found

    return coefficients


def _first(argument):
    return argument[0] if isinstance(argument, list) else argument
