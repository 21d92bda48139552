"""Time derivatives of functions along the motion of a vector field."""

import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import numpy as np

from ._jaxprs import without_unused
from ._scalarise import evaluated, SplitProgram, traced
from ._scalars import Memory, once
from ._taylor import coefficient, Series


class MotionSeries(NamedTuple):
    """Time derivatives of the motion through a state, as arrays of scalars."""

    rates: list
    """The first, second, ... time derivative of the state, `(n,)` each."""
    along: list
    """The other results of the program, and their first, second, ... derivatives."""


def motion_series(function: Callable, orders, *example) -> SplitProgram:
    """Return the time derivatives of functions along a motion.

    **Arguments:** `function(parameters, t, x, *rest)` of arrays, which returns the
    vector field, `(n,)`, and a pytree of arrays; a pytree with the highest derivative
    of each of these arrays, beyond which zero is returned; and examples of the
    arguments of the function.

    Returns:
        A function of the same arguments with split arrays as leaves.
    """
    closed, shape = jax.make_jaxpr(function, return_shape=True)(*example)
    _, others = shape
    treedef, number = jax.tree.structure(others), len(jax.tree.leaves(others))
    highest = jax.tree.leaves(orders)
    order = max(highest)
    field = without_unused(closed, [True] + [False] * number)
    rest = without_unused(closed, [False] + [True] * number)

    def call(parameters, t, x, *arguments, memory: Memory) -> MotionSeries:
        (x,) = jax.tree.leaves(x)
        powers = [[e] for e in x]

        def at(program, k: int):
            """Return the results of a program, with series up to order k."""
            # all series have the same length, which also limits that of the results
            rates = (np.float64(1.0), *(np.float64(0.0),) * (k - 1))
            time = Series([t, *rates]) if k else t
            state = np.empty(len(powers), dtype=object)
            for i, known in enumerate(powers):
                state[i] = Series(known[: k + 1]) if k else known[0]
            leaves = jax.tree.leaves((parameters, time, state, *arguments))
            return evaluated(program, leaves, memory)

        for k in range(order):
            (rate,) = at(field, k)
            for known, element in zip(powers, rate, strict=True):
                known.append(_product(coefficient(element, k), 1 / (k + 1), memory))
        found = at(rest, order)
        along = [
            jax.tree.unflatten(
                treedef,
                [
                    _derivative(part, k if k <= most else order + 1, memory)
                    for part, most in zip(found, highest, strict=True)
                ],
            )
            for k in range(order + 1)
        ]
        rates = []
        for k in range(1, order + 1):
            rate, factor = np.empty(len(powers), dtype=object), math.factorial(k)
            for i, known in enumerate(powers):
                rate[i] = _product(known[k], factor, memory)
            rates.append(traced(rate, memory))
        return MotionSeries(rates, along)

    return SplitProgram(call, closed)


def _derivative(elements: np.ndarray, order: int, memory) -> np.ndarray:
    out = np.empty(elements.shape, dtype=object)
    for index in np.ndindex(elements.shape):
        part = coefficient(elements[index], order)
        out[index] = _product(part, math.factorial(order), memory)
    return traced(out, memory)


def _product(scalar, number: float, memory: Memory):
    """Return a scalar times a number."""
    if number == 1.0:
        return scalar
    return once(jax.lax.mul_p, {}, (scalar, np.float64(number)), memory)
