"""Take explicit Runge-Kutta steps of scalars or arrays, and integrate flights.

All free flights are computed with these steps, using the tableau of a diffrax solver.
The event loop unrolls the steps into scalars. Variational theory and fits use array
steps with a loop over the stages, which are equally fast and compile in a tenth of the
time.
"""

import functools
from collections.abc import Callable
from typing import Any, NamedTuple

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from .lowering import while_loop


class Tableau(NamedTuple):
    """Coefficients of a method as plain numbers; an unrolled step skips zeros."""

    lower: tuple[tuple[float, ...], ...]
    """Coefficients of the stages, one row per stage after the first."""
    nodes: tuple[float, ...]
    """Nodes of the stages after the first."""
    weights: tuple[float, ...]
    """Weights of the stages in the result."""
    error: tuple[float, ...]
    """Weights of the stages in the error estimate."""
    order: int
    """Order of the method."""


def tableau_of(solver) -> Tableau:
    """Return the tableau of an explicit diffrax Runge-Kutta solver with an error
    estimate.

    Raises:
        ValueError: The solver is implicit or has no error estimate.
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
    # a last stage that is used only by the next step is not needed here
    last = int(np.max(np.nonzero((weights != 0) | (error != 0)))) + 1
    return Tableau(
        lower=tuple(tuple(map(float, row)) for row in table.a_lower[: last - 1]),
        nodes=(0.0, *map(float, table.c[: last - 1])),
        weights=tuple(map(float, weights[:last])),
        error=tuple(map(float, error[:last])),
        order=solver.order(diffrax.ODETerm(lambda t, y, args: y)) or 1,
    )


DOPRI5 = tableau_of(diffrax.Dopri5())
"""Tableau of the fifth-order Dormand-Prince method."""
DOPRI8 = tableau_of(diffrax.Dopri8())
"""Tableau of the eighth-order Dormand-Prince method."""
RK4 = Tableau(
    lower=((0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)),
    nodes=(0.0, 0.5, 0.5, 1.0),
    weights=(1 / 6, 1 / 3, 1 / 3, 1 / 6),
    error=(0.0,) * 4,
    order=4,
)
"""Tableau of the classical fourth-order method, which is not in diffrax; it has no
error estimate.
"""


class Squared(NamedTuple):
    """Coefficients for a component y whose rate is another component, so that y'' = f.

    The stages of y are y + c h y' + h^2 times the sum of `lower` times f. They do not
    use the stages of y', which are needed only if f depends on y'.
    """

    lower: tuple[tuple[float, ...], ...]
    weights: tuple[float, ...]
    error: tuple[float, ...]


def _lower(tableau: Tableau) -> np.ndarray:
    """Return the coefficients of all stages as a square matrix."""
    a = np.zeros((len(tableau.weights),) * 2)
    for i, row in enumerate(tableau.lower, start=1):
        a[i, : len(row)] = row
    return a


@functools.cache
def squared(tableau: Tableau) -> Squared:
    """Return the tableau applied twice (the Nystroem form of a Runge-Kutta step)."""
    a = _lower(tableau)
    lower = a @ a
    rows = np.vstack([lower, np.asarray(tableau.weights) @ a, tableau.error @ a])
    # sums that vanish by the order conditions are nonzero only because of rounding
    rows[np.abs(rows) < 1e-14] = 0.0
    *stages, weights, error = (tuple(map(float, row)) for row in rows)
    return Squared(tuple(stages[1:]), weights, error)


def _combine(weights, stages, i):
    """Return the weighted sum of component `i` of the stages; None if it is empty."""
    total = None
    for w, s in zip(weights, stages):
        if w != 0.0:
            total = w * s[i] if total is None else total + w * s[i]
    return total


def step(tableau: Tableau, field, t, x: tuple, h):
    """Take one step of length `h` from `(t, x)`.

    **Arguments:** `x` and the result of `field(t, x)` are tuples of scalars.

    Returns:
        The state after the step, the error estimate, and the stages.
    """
    n = len(x)
    first = field(t, x)
    rate_of = rates_among(x, first)
    twice = squared(tableau)
    h2 = h * h

    def moved(i, node, once, double):
        """Return the change of component i over the step, or over part of it."""
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
    error = [0.0 * x[i] for i in range(n)]
    if any(tableau.error):
        error = [moved(i, 0.0, tableau.error, twice.error) for i in range(n)]
    return tuple(a + b for a, b in zip(x, change, strict=True)), tuple(error), stages


def rates_among(x, rates) -> dict[int, int]:
    """Return which components are rates of change of others, as velocities are of
    positions.
    """
    found = {}
    for i, rate in enumerate(rates):
        for j, component in enumerate(x):
            if rate is component and i != j:
                found[i] = j
    # a component whose second derivative is also a component is integrated directly,
    # because otherwise there would be a third level
    return {i: j for i, j in found.items() if j not in found}


def array_step(
    tableau: Tableau,
    field: Callable,
    t,
    x: Float[Array, " n"],
    h,
    *,
    unrolled: bool = False,
) -> tuple[Float[Array, " n"], Float[Array, " n"], Float[Array, " n"]]:
    """Take one Runge-Kutta step of length `h` from `(t, x)` along `field(t, x)`.

    Args:
        tableau: Coefficients of the method.
        field: The vector field, `field(t, x)`, shape `(n,)`.
        t: Time (s).
        x: State, shape `(n,)`.
        h: Step length (s).
        unrolled: Whether to write out the stages one by one, for steps in a hot loop;
            otherwise `field` is compiled only once.

    Returns:
        The state after the step, its error estimate, and the rate at `(t, x)`, each
            `(n,)`.

    Examples:
        >>> from jaxcam.hybrid.runge_kutta import RK4, array_step
        >>> after, _, _ = array_step(RK4, lambda t, x: -x, 0.0, jnp.ones(1), 0.1)
        >>> round(float(after[0]), 6)
        0.904837
    """
    if unrolled:
        one: Any = step(tableau, lambda s, y: (field(s, y[0]),), t, (x,), h)
        (after,), (error,), stages = one
        return after, error, stages[0][0]

    def stage(rates, row):
        i, lower, node = row
        rate = field(t + node * h, x + h * _weighted(lower, rates))
        return rates.at[i].set(rate), None

    def chained(rate, row):
        share, node = row
        rate = field(t + node * h, x + share * h * rate)
        return rate, rate

    numbers = (_lower(tableau), tableau.nodes, tableau.weights, tableau.error)
    lower, nodes, weights, wrong = map(jnp.asarray, numbers)
    if any(any(row[:-1]) for row in tableau.lower):
        empty = jnp.zeros((len(tableau.nodes), *x.shape), x.dtype)
        rows = (jnp.arange(len(tableau.nodes)), lower, nodes)
        rates, _ = jax.lax.scan(stage, empty, rows)
    else:
        # each stage needs only the previous one, so the scan carries only that one
        shares = jnp.asarray([0.0, *(row[-1] for row in tableau.lower)])
        _, rates = jax.lax.scan(chained, jnp.zeros_like(x), (shares, nodes))
    return x + h * _weighted(weights, rates), h * _weighted(wrong, rates), rates[0]


def _weighted(weights, rates):
    """Return the weighted sum of the stages; a matrix product would be slower to
    differentiate.
    """
    return jnp.sum(weights[:, None] * rates, axis=0)


def fixed_steps(
    tableau: Tableau, field: Callable, t0, x0: Float[Array, " n"], t1, steps: int
) -> tuple[Float[Array, " s"], Float[Array, "s n"], Float[Array, "s n"]]:
    """Integrate `field(t, x)` from `(t0, x0)` to `t1` in equal steps.

    Args:
        tableau: Coefficients of the method.
        field: The vector field, `field(t, x)`, shape `(n,)`.
        t0: Start time (s).
        x0: Initial state, shape `(n,)`.
        t1: End time (s).
        steps: Number of steps, s.

    Returns:
        Times `(s,)`, states `(s, n)` and error estimates `(s, n)` at the ends of the
            steps.

    Examples:
        >>> from jaxcam.hybrid.runge_kutta import RK4, fixed_steps
        >>> _, states, _ = fixed_steps(RK4, lambda t, x: -x, 0.0, jnp.ones(1), 1.0, 10)
        >>> round(float(states[-1, 0]), 5)
        0.36788
    """
    h = (t1 - t0) / steps

    def one(x, k):
        after, error, _ = array_step(tableau, field, t0 + k * h, x, h)
        return after, (after, error)

    count = jnp.arange(steps, dtype=jnp.float64)
    _, (states, errors) = jax.lax.scan(one, x0, count)
    return t0 + (count + 1) * h, states, errors


def adaptive_steps(
    tableau: Tableau,
    field: Callable,
    t0,
    x0: Float[Array, " n"],
    t1,
    tolerance: float,
    max_steps: int = 4096,
) -> Float[Array, " n"]:
    """Integrate `field(t, x)` from `(t0, x0)` to `t1` with adaptive steps.

    Derivatives are computed with the step lengths held fixed.

    Args:
        tableau: Coefficients of a method with an error estimate.
        field: The vector field, `field(t, x)`, shape `(n,)`.
        t0: Start time (s).
        x0: Initial state, shape `(n,)`.
        t1: End time (s).
        tolerance: Error allowed per step, relative to 1 + |x|.
        max_steps: Maximum number of attempted steps.

    Returns:
        The state at `t1`, shape `(n,)`; NaN if it is not reached within `max_steps`
            attempts.

    Examples:
        >>> from jaxcam.hybrid.runge_kutta import DOPRI5, adaptive_steps
        >>> end = adaptive_steps(DOPRI5, lambda t, x: -x, 0.0, jnp.ones(1), 1.0, 1e-9)
        >>> round(float(end[0]), 6)
        0.367879
    """
    span = t1 - t0

    def goes_on(carry):
        share, _, _, count = carry
        return (share < 1) & (count < max_steps)

    def advance(carry):
        share, part, x, count = carry
        part = jnp.minimum(part, 1 - share)
        end, error, _ = array_step(tableau, field, t0 + share * span, x, part * span)
        scaled = jnp.abs(error) / (tolerance * (1 + jnp.abs(end)))
        size = jax.lax.stop_gradient(jnp.max(scaled))
        good = size <= 1
        factor = 0.9 * jnp.maximum(size, 1e-12) ** (-1 / tableau.order)
        # a NaN error means that the step is too long
        factor = jnp.where(jnp.isfinite(size), jnp.clip(factor, 0.2, 2.0), 0.2)
        share = jnp.where(good, share + part, share)
        return share, part * factor, jnp.where(good, end, x), count + 1

    start = (jnp.zeros(()), jnp.asarray(1 / 8), x0, 0)
    share, _, x, _ = while_loop(goes_on, advance, start)
    return jnp.where(share >= 1, x, jnp.nan)
