"""One explicit Runge-Kutta step, unrolled from the tableau of a diffrax solver."""

import functools
from typing import NamedTuple

import diffrax
import jax.numpy as jnp
import numpy as np

from ._select import largest


class Tableau(NamedTuple):
    """Coefficients as plain numbers; zeros are skipped when the step is unrolled."""

    lower: tuple[tuple[float, ...], ...]
    nodes: tuple[float, ...]
    weights: tuple[float, ...]
    error: tuple[float, ...]
    order: int


def tableau_of(solver) -> Tableau:
    """The tableau of an explicit diffrax Runge-Kutta solver with an error estimate.

    **Raises:** `ValueError` for an implicit solver or one without an error estimate.
    """
    table = getattr(solver, "tableau", None)
    name = type(solver).__name__
    if not isinstance(solver, diffrax.AbstractERK) or table is None:
        raise ValueError(
            f"{name} is not an explicit Runge-Kutta solver; pass one "
            '(diffrax.Dopri8(), diffrax.Tsit5()) or use engine="diffeqsolve"'
        )
    error = np.asarray(table.b_error, dtype=float)
    if not np.any(error):
        raise ValueError(
            f"{name} has no error estimate; pass an adaptive solver such as "
            "diffrax.Dopri8() or diffrax.Tsit5()"
        )
    weights = np.asarray(table.b_sol, dtype=float)
    # a last stage that serves only the next step is not needed here
    last = int(np.max(np.nonzero((weights != 0) | (error != 0)))) + 1
    return Tableau(
        lower=tuple(tuple(map(float, row)) for row in table.a_lower[: last - 1]),
        nodes=(0.0, *map(float, table.c[: last - 1])),
        weights=tuple(map(float, weights[:last])),
        error=tuple(map(float, error[:last])),
        order=solver.order(diffrax.ODETerm(lambda t, y, args: y)) or 1,
    )


class Squared(NamedTuple):
    """Coefficients of a component whose rate is another component, y'' = f.

    Its stages are y + c h y' + h^2 sum of `lower` times f, so that the rates of the
    component itself are not summed, and those of y' only where f depends on it.
    """

    lower: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]
    error: tuple[float, ...]


@functools.cache
def squared(tableau: Tableau) -> Squared:
    """The tableau applied twice. (Nystroem's form of a Runge-Kutta step)"""
    number = len(tableau.weights)
    a = np.zeros((number, number))
    for i, row in enumerate(tableau.lower, start=1):
        a[i, : len(row)] = row
    lower = a @ a
    rows = np.vstack([lower, np.asarray(tableau.weights) @ a, tableau.error @ a])
    # sums that vanish by the order conditions leave rounding behind
    rows[np.abs(rows) < 1e-14] = 0.0
    *stages, weights, error = (tuple(map(float, row)) for row in rows)
    return Squared(tuple(stages[1:]), weights, error)


def _combine(weights, stages, i):
    """Sum of component `i` of the stages with constant weights; None where empty."""
    total = None
    for w, s in zip(weights, stages):
        if w != 0.0:
            total = w * s[i] if total is None else total + w * s[i]
    return total


def step(tableau: Tableau, field, t, x: tuple, h):
    """One step of length `h` from `(t, x)`.

    **Arguments:** `field(t, x)` and `x` work on tuples of scalars.

    **Returns:** the state after the step, the error estimate, and the stages.
    """
    n = len(x)
    first = field(t, x)
    rate_of = _rates_among(x, first)
    twice = squared(tableau)
    h2 = h * h

    def moved(i, node, once, double):
        """Change of component i over the step, or over a part of it."""
        if i not in rate_of:
            return h * _combine(once, stages, i)
        change = node * (h * x[rate_of[i]]) if node != 0.0 else None
        bend = _combine(double, stages, rate_of[i])
        if bend is None:
            return change
        return h2 * bend if change is None else change + h2 * bend

    stages = [first]
    for k, node in enumerate(tableau.nodes[1:]):
        parts = node, tableau.lower[k], twice.lower[k]
        point = tuple(x[i] + moved(i, *parts) for i in range(n))
        stages.append(field(t + node * h, point))
    change = [moved(i, 1.0, tableau.weights, twice.weights) for i in range(n)]
    error = [moved(i, 0.0, tableau.error, twice.error) for i in range(n)]
    return tuple(a + b for a, b in zip(x, change, strict=True)), tuple(error), stages


def error_norm(error, before, after, tolerance):
    """Largest error of a step over the error allowed, relative and absolute alike."""
    parts = [
        jnp.abs(e) / (tolerance * (1.0 + jnp.maximum(jnp.abs(a), jnp.abs(b))))
        for e, a, b in zip(error, before, after, strict=True)
    ]
    return largest(parts)


def _rates_among(x, rates) -> dict[int, int]:
    """Which components are rates of others, as they stand: position and velocity."""
    found = {}
    for i, rate in enumerate(rates):
        for j, component in enumerate(x):
            if rate is component and i != j:
                found[i] = j
    # the rate itself must be integrated as it is, or there would be a third level
    return {i: j for i, j in found.items() if j not in found}
