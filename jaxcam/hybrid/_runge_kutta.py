"""One explicit Runge-Kutta step, unrolled from the tableau of a diffrax solver."""

from typing import NamedTuple

import diffrax
import numpy as np


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


def _combine(weights, stages, n):
    """Sum of the stages with constant weights, component by component."""
    used = [(w, s) for w, s in zip(weights, stages) if w != 0.0]
    out = []
    for i in range(n):
        total = used[0][0] * used[0][1][i]
        for w, s in used[1:]:
            total = total + w * s[i]
        out.append(total)
    return out


def step(tableau: Tableau, field, t, x: tuple, h):
    """One step of length `h` from `(t, x)`.

    **Arguments:** `field(t, x)` and `x` work on tuples of scalars.

    **Returns:** the state after the step, the error estimate, and the stages.
    """
    n = len(x)
    stages = [field(t, x)]
    for row, c in zip(tableau.lower, tableau.nodes[1:], strict=True):
        increment = _combine(row, stages, n)
        point = tuple(x[i] + h * increment[i] for i in range(n))
        stages.append(field(t + c * h, point))
    change = _combine(tableau.weights, stages, n)
    error = _combine(tableau.error, stages, n)
    after = tuple(x[i] + h * change[i] for i in range(n))
    return after, tuple(h * e for e in error), stages
