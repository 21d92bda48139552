"""Apply Newton's method with one evaluation of all quantities per iterate.

Each place at which a program evaluates the motion over a period is compiled separately,
and this takes much longer than running it. Here, the values, the derivatives and all
other quantities of an iterate come from one evaluation in the loop; those of the
solution are the results of the last one. The loop is part of a traced program, or is
run by Python.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np


class Solved(NamedTuple):
    """The result of Newton's method."""

    y: Any
    success: Any
    iterations: Any
    found: Any
    """All results of the evaluation at y."""


def newton_at_once(
    evaluate: Callable, equations: Callable, y, tolerance, iterations: int, given: Any
) -> Solved:
    """Return a root and the results of the evaluation there.

    With fewer equations than unknowns, each correction has the least norm
    (Moore-Penrose). The tolerance applies to the equations, and to the corrections
    relative to one plus the unknowns, as in `optimistix.Newton`.

    **Arguments:**

    - `evaluate(y)`: all results at y, a pytree of arrays.
    - `equations(y, found)`: the equations and their Jacobian.
    - `iterations`: largest number of corrections.
    - `given`: whether y is the solution, at which everything is only evaluated.
    """
    # the function is traced once: the loop needs to know its results in advance
    evaluate = eqx.filter_closure_convert(evaluate, y)
    empty = jax.tree.map(
        lambda one: jnp.zeros(one.shape, one.dtype),
        evaluate.out_struct,  # pyright: ignore
    )
    no = jnp.asarray(False)

    def unfinished(carry):
        return ~carry[-1]

    def body(carry):
        y, _, success, count, last, _ = carry
        found = evaluate(y)
        value, matrix = equations(y, found)
        step = _correction(matrix, value)
        moved = y - step
        small = jnp.max(jnp.abs(step) / (tolerance * (1.0 + jnp.abs(moved)))) < 1
        small = small & (jnp.max(jnp.abs(value)) < tolerance)
        ends = small | ~jnp.all(jnp.isfinite(step)) | (count + 1 >= iterations)
        y = jnp.where(last, y, moved)
        success = jnp.where(last, success, small)
        return y, found, success, jnp.where(last, count, count + 1), last | ends, last

    last = jnp.asarray(given) | (iterations < 1)
    first = y, empty, no, jnp.asarray(0), last, no
    y, found, success, count, _, _ = jax.lax.while_loop(unfinished, body, first)
    return Solved(y, success & jnp.all(jnp.isfinite(y)), count, found)


def newton_on_host(
    evaluate: Callable,
    equations: Callable,
    y,
    tolerance,
    iterations: int,
    given: bool,
    first: Any = None,
) -> Solved:
    """Return the same as `newton_at_once`, for functions that are called from Python
    and return NumPy arrays. Nothing is evaluated where an unknown is not finite.

    **Arguments:** `first`: the results of the evaluation at y, if they are known.
    """
    y, success, count = np.asarray(y), False, 0
    tolerance = float(tolerance)
    found = evaluate(y) if first is None else first
    while not given and count < iterations:
        value, matrix = equations(y, found)
        try:
            step = _correction(matrix, value, np)
        except np.linalg.LinAlgError:
            step = np.full_like(y, np.nan)
        y, count = y - step, count + 1
        if not np.all(np.isfinite(y)):
            break
        found = evaluate(y)
        small = np.max(np.abs(step) / (tolerance * (1.0 + np.abs(y)))) < 1
        success = bool(small and np.max(np.abs(value)) < tolerance)
        if success:
            break
    return Solved(y, success, count, found)


def _correction(matrix, value, xp=jnp):
    rows, columns = matrix.shape
    if rows == columns:
        return xp.linalg.solve(matrix, value)
    return matrix.T @ xp.linalg.solve(matrix @ matrix.T, value)
