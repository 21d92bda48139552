"""Derive the motion normal to the constraints from the three functions of a system.

The notation is that of the thesis: H is the gap, v = dH/dt the normal velocity, a and j
are its first and second derivatives along the active field, and W is the impulse
direction in x+ = x + W v (thesis, eq. 2.27). Here, the unit direction D = W / (v_x W)
is used: moving by D changes the normal velocity by one and leaves the gap unchanged. D
does not depend on the restitution, and the sticking field (thesis, eqs. 2.30 and 2.31)
becomes F - a D.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system import HybridSystem
from .._types import RealScalar, State


def gaps(system: HybridSystem, t: RealScalar, x: State) -> Float[Array, " m"]:
    """Return all gaps as a vector, whether the system defines one or several.

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        Gaps, shape `(m,)`.

    Examples:
        >>> from jaxcam.hybrid.surface import gaps
        >>> from jaxcam.models import BouncingBall
        >>> gaps(BouncingBall(), 0.0, jnp.array([1.0, 0.0])).tolist()
        [1.0]
    """
    return jnp.atleast_1d(system.gap(t, x))


def lie_derivative(function: Callable, field: Callable) -> Callable:
    """Return the rate of change of `function(t, x)` along `field`, including that due
    to the explicit dependence on time.
    """

    def derivative(t, x):
        return jax.jvp(function, (t, x), (jnp.ones_like(t), field(t, x)))[1]

    return derivative


def lie_series(function: Callable, field: Callable, order: int) -> Callable:
    """Return `function` and its rates of change along `field` up to `order`, as a
    tuple.

    Each level is differentiated together with those below it, which costs less than
    differentiating them one after the other.
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


def along_path(function: Callable, t, x, rates: tuple, order: int) -> tuple:
    """Return `function` and its rates of change up to `order` along a motion through
    `(t, x)`, whose first rates are given.

    The function may return any pytree. In contrast to `lie_series`, the field is not
    evaluated again.
    """

    def at(time):
        change, number = rates[-1], len(rates)
        for k in reversed(range(number - 1)):
            change = rates[k] + time * change / (k + 2)
        return (function(t + time, x + time * change),)

    def one_more(below):
        def series(time):
            values, slopes = jax.jvp(below, (time,), (jnp.ones_like(time),))
            return (*values, slopes[-1])

        return series

    series = at
    for _ in range(order):
        series = one_more(series)
    return series(jnp.zeros(()))


def motion_rates(field: Callable, t, x) -> tuple[State, State, State]:
    """Return the first three time derivatives of the motion through `(t, x)`."""
    first = field(t, x)
    _, second = along_path(field, t, x, (first,), 1)
    *_, third = along_path(field, t, x, (first, second), 2)
    return first, second, third


def normal_velocity(system, t, x) -> Float[Array, " m"]:
    """Return the normal velocity v = H_t + H_x F of each constraint, where H is the
    gap, F the vector field, and subscripts denote partial derivatives (thesis, eq.
    2.26).

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        Normal velocities, shape `(m,)`.

    Examples:
        >>> from jaxcam.hybrid.surface import normal_velocity
        >>> from jaxcam.models import BouncingBall
        >>> normal_velocity(BouncingBall(), 0.0, jnp.array([1.0, -2.0])).tolist()
        [-2.0]
    """
    return lie_derivative(
        lambda s, y: gaps(system, s, y), lambda s, y: system.vector_field(s, y)
    )(t, x)


def normal_acceleration(system, t, x) -> Float[Array, " m"]:
    """Return the normal acceleration a = dv/dt of each constraint in free flight, where
    v is the normal velocity (thesis, eq. 2.29).

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        Normal accelerations, shape `(m,)`.

    Examples:
        >>> from jaxcam.hybrid.surface import normal_acceleration
        >>> from jaxcam.models import BouncingBall
        >>> normal_acceleration(BouncingBall(), 0.0, jnp.array([1.0, -2.0])).tolist()
        [-9.81]
    """
    return lie_derivative(
        lambda s, y: normal_velocity(system, s, y),
        lambda s, y: system.vector_field(s, y),
    )(t, x)


def normal_directions(system, t, x) -> Float[Array, "m n"]:
    """Return the direction D of the impulse for each constraint.

    D is scaled so that v_x D = 1, where v is the normal velocity and v_x its gradient.
    An impact changes the state by W v, and W is parallel to D. The direction is found
    from the derivative of this change along v_x; this is exact where v is zero.

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        Directions, shape `(m, n)`; moving by one of them changes the normal velocity by
            one.

    Examples:
        >>> from jaxcam.hybrid.surface import normal_directions
        >>> from jaxcam.models import BouncingBall
        >>> d = normal_directions(BouncingBall(), 0.0, jnp.array([0.0, -2.0]))
        >>> d.shape, float(d[0, 1])
        ((1, 2), 1.0)
    """
    gradient = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    return unit_directions(system, t, x, gradient)


def unit_directions(system, t, x, gradient: Float[Array, "m n"]):
    """Return the directions D, given the gradients of the normal velocities."""
    number = gradient.shape[0]
    if not number:
        return gradient
    rows = []
    for k in range(number):
        _, moved = jax.jvp(
            lambda y, k=k: jnp.atleast_2d(system.impact(t, y))[k] - y,
            (x,),
            (gradient[k],),
        )
        # only the direction matters, because its length is fixed by v_x D = 1; a gap
        # that does not depend on the state has none
        constant = jnp.all(gradient[k] == 0)
        rows.append(moved / jnp.where(constant, 1.0, jnp.sum(gradient[k] * moved)))
    return jnp.stack(rows)


def free_jet(system, t, x) -> Float[Array, "m 4"]:
    """Return gap H, velocity v, acceleration a and jerk j of each constraint in free
    flight.

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        One row H, v, a, j per constraint, shape `(m, 4)`.

    Examples:
        >>> from jaxcam.hybrid.surface import free_jet
        >>> from jaxcam.models import BouncingBall
        >>> free_jet(BouncingBall(), 0.0, jnp.array([1.0, -2.0])).tolist()
        [[1.0, -2.0, -9.81, 0.0]]
    """

    def field(s, y):
        return system.vector_field(s, y)

    def gap(s, y):
        return gaps(system, s, y)

    return jnp.stack(lie_series(gap, field, 3)(t, x), axis=1)
