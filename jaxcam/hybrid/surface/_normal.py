"""Motion normal to the constraints, derived from the three stated functions.

Notation of the thesis: H gap, v = dH/dt normal velocity, a and j its first and second
derivative along the field in force, W the impulse direction of x+ = x + W v (2.27).
Here the unit direction D = W / (v_x W) is used: moving by D changes the normal velocity
by one and leaves the gap alone. It does not depend on the restitution, and the sticking
field (2.30)-(2.31) becomes F - a D.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system import HybridSystem
from .._types import RealScalar, State


def gaps(system: HybridSystem, t: RealScalar, x: State) -> Float[Array, " m"]:
    """All gaps as a vector, whether the system states one or several."""
    return jnp.atleast_1d(system.gap(t, x))


def gap_rounding(
    system: HybridSystem, t: RealScalar, x: State, reach: State
) -> Float[Array, " m"]:
    """What rounding can tell of each gap, for components as large as `reach`."""
    return _rounding(lambda s, y: gaps(system, s, y), t, x, reach)


def speed_rounding(
    system: HybridSystem, t: RealScalar, x: State, reach: State
) -> Float[Array, " m"]:
    """What rounding can tell of each normal velocity."""
    return _rounding(lambda s, y: normal_velocity(system, s, y), t, x, reach)


def start_room(rounding, acceleration, time):
    """How far from the surface, or how fast, a start may be and count as in contact.

    **Arguments:** what rounding can tell; the normal acceleration; and the time in
    which it acts (s), squared for a distance. A start at the origin of a coordinate has
    no other size than that of the forced motion.
    """
    return 500 * rounding + 1e-12 * jnp.abs(acceleration) * time


def forced_time(period):
    """The period over 2 pi, or zero for a system without one (`None`, or inf)."""
    if period is None:
        return jnp.zeros(())
    return jnp.where(jnp.isfinite(period), period / (2 * jnp.pi), 0.0)


def least_gaps(system, t, x, room: RealScalar = 1.0) -> Float[Array, " m"]:
    """The gaps of a start, and `room` times what is not told from zero added to them.

    A start is in front of the constraints where none of them is negative.
    """
    rounding = gap_rounding(system, t, x, jnp.abs(x))
    acceleration = normal_acceleration(system, t, x)
    time = forced_time(system.period) ** 2
    return gaps(system, t, x) + room * start_room(rounding, acceleration, time)


def _rounding(function: Callable, t, x, reach):
    """How far rounding of `t` and `x` moves a function.

    A state is right to some parts in 1e15 of its components; a time, and a phase made
    of it, to two parts in 1e16 each.
    """
    by_state = jax.jacfwd(lambda y: function(t, y))(x)
    by_time = jax.jvp(lambda s: function(s, x), (t,), (jnp.ones_like(t),))[1]
    size = jnp.sum(jnp.abs(by_state) * reach[None], axis=1)
    return 2e-15 * size + 4e-16 * jnp.abs(t * by_time)


def impacts(system: HybridSystem, t: RealScalar, x: State) -> Float[Array, "m n"]:
    """The state after an impact at each constraint, one row for each."""
    return jnp.atleast_2d(system.impact(t, x))


def lie_derivative(function: Callable, field: Callable) -> Callable:
    """Rate of change of `function(t, x)` along `field`, explicit time included."""

    def derivative(t, x):
        return jax.jvp(function, (t, x), (jnp.ones_like(t), field(t, x)))[1]

    return derivative


def lie_series(function: Callable, field: Callable, order: int) -> Callable:
    """`function` and its rates of change along `field` up to `order`, as a tuple.

    Each level is differentiated together with those below it, which costs less than one
    after the other.
    """

    def first(t, x):
        return (function(t, x),)

    def one_more(below):
        def series(t, x):
            values, rates = jax.jvp(below, (t, x), (jnp.ones_like(t), field(t, x)))
            return (*values, rates[-1])

        return series

    series = first
    for _ in range(order):
        series = one_more(series)
    return series


def normal_velocity(system, t, x) -> Float[Array, " m"]:
    """v = H_t + H_x F for each constraint. (2.26)"""
    return lie_derivative(
        lambda s, y: gaps(system, s, y), lambda s, y: system.vector_field(s, y)
    )(t, x)


def normal_acceleration(system, t, x) -> Float[Array, " m"]:
    """a = dv/dt in free flight for each constraint. (2.29)"""
    return lie_derivative(
        lambda s, y: normal_velocity(system, s, y),
        lambda s, y: system.vector_field(s, y),
    )(t, x)


def normal_directions(system, t, x) -> Float[Array, "m n"]:
    """D for each constraint, exact where the normal velocity is zero.

    R(x) - x = W v vanishes with v, so W is found from its derivative in a direction
    that changes v; the gradient of v is one.
    """
    gradient = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    number = gradient.shape[0]
    rows = []
    for k in range(number):
        _, moved = jax.jvp(
            lambda y, k=k: impacts(system, t, y)[k] - y, (x,), (gradient[k],)
        )
        # the direction only: its length is fixed by v_x D = 1
        rows.append(moved / jnp.sum(gradient[k] * moved))
    return jnp.stack(rows)


def contact_multipliers(system, t, x, contact: Bool[Array, " m"]) -> Float[Array, " m"]:
    """q with F_s = F - sum q_k D_k over the constraints in contact.

    With one constraint q = a. The constraint presses while q < 0 and lets go where q
    rises through zero. Zero for constraints that are not in contact.
    """
    acceleration = normal_acceleration(system, t, x)
    if acceleration.shape[0] == 1:
        return jnp.where(contact, acceleration, jnp.zeros_like(acceleration))
    directions = normal_directions(system, t, x)
    gradient = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    return _solve_masked(gradient @ directions.T, acceleration, contact)


def field_in_force(system, t, x, contact: Bool[Array, " m"]) -> State:
    """Free flight, or sticking on the constraints marked in `contact`. (2.30)"""
    multipliers = contact_multipliers(system, t, x, contact)
    directions = normal_directions(system, t, x)
    push = jnp.sum(multipliers[:, None] * directions, axis=0)
    return system.vector_field(t, x) - push


def sticking_field(system: HybridSystem, t: RealScalar, x: State) -> State:
    """The field of sustained contact with every constraint. (2.30)-(2.31)

    **Arguments:** `t` (s) and the state, shape `(n,)`, on the surface.

    **Returns:** rate of change of the state, shape `(n,)`.
    """
    everywhere = jnp.ones(gaps(system, t, x).shape, dtype=bool)
    return field_in_force(system, t, x, everywhere)


def free_jet(system, t, x) -> Float[Array, "m 4"]:
    """H, v, a, j of each gap in free flight."""

    def field(s, y):
        return system.vector_field(s, y)

    def gap(s, y):
        return gaps(system, s, y)

    return jnp.stack(lie_series(gap, field, 3)(t, x), axis=1)


def mode_jet(system, t, x, contact: Bool[Array, " m"]) -> Float[Array, "m 4"]:
    """H, v, a, j of each gap along the field in force.

    For a constraint in contact a and j are the multiplier q and its rate, whose zero is
    the release.
    """

    def field(s, y):
        return field_in_force(system, s, y, contact)

    def gap(s, y):
        return gaps(system, s, y)

    def multiplier(s, y):
        return contact_multipliers(system, s, y, contact)

    value, velocity, acceleration, jerk = lie_series(gap, field, 3)(t, x)
    pressing, release = lie_series(multiplier, field, 1)(t, x)
    return jnp.stack(
        [
            value,
            velocity,
            jnp.where(contact, pressing, acceleration),
            jnp.where(contact, release, jerk),
        ],
        axis=1,
    )


def restitution_coefficients(system, t, x) -> Float[Array, " m"]:
    """r of each constraint in the limit of slow impacts: v changes from v to -r v."""
    directions = normal_directions(system, t, x)

    def rebound(speed, k):
        after = impacts(system, t, x + speed * directions[k])[k]
        return normal_velocity(system, t, after)[k]

    zero = jnp.zeros_like(t)
    return jnp.stack(
        [
            -jax.jvp(lambda s, k=k: rebound(s, k), (zero,), (jnp.ones_like(t),))[1]
            for k in range(directions.shape[0])
        ]
    )


def _solve_masked(matrix, right, mask):
    """Solve for the masked unknowns, zero elsewhere; elimination without pivoting.

    The matrix has a unit diagonal and is small (one row a constraint); unrolled so that
    a batch of them stays elementwise.
    """
    number = right.shape[0]
    rows = [
        [
            jnp.where(mask[i] & mask[k], matrix[i, k], jnp.asarray(float(i == k)))
            for k in range(number)
        ]
        for i in range(number)
    ]
    values = [
        jnp.where(mask[i], right[i], jnp.zeros_like(right[i])) for i in range(number)
    ]
    for p in range(number):
        for i in range(p + 1, number):
            factor = rows[i][p] / rows[p][p]
            rows[i] = [a - factor * b for a, b in zip(rows[i], rows[p], strict=True)]
            values[i] = values[i] - factor * values[p]
    for p in reversed(range(number)):
        for k in range(p + 1, number):
            values[p] = values[p] - rows[p][k] * values[k]
        values[p] = values[p] / rows[p][p]
    return jnp.stack(values)
