"""Derive the motion normal to the constraints from the three functions of a system.

The notation is that of the thesis: H is the gap, v = dH/dt the normal velocity, a and j
are its first and second derivatives along the active field, and W is the impulse
direction in x+ = x + W v (thesis, eq. 2.27). Here, the unit direction D = W / (v_x W)
is used: moving by D changes the normal velocity by one and leaves the gap unchanged. It
does not depend on the restitution, and the sticking field (thesis, eqs. 2.30 and 2.31)
becomes F - a D.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._contact_friction import friction_of, has_friction
from ._masked import solve_masked


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
    """Return the rate of change of `function(t, x)` along `field`, including explicit
    time.
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


def normal_velocity(system, t, x) -> Float[Array, " m"]:
    """Return v = H_t + H_x F for each constraint (thesis, eq. 2.26).

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
    """Return a = dv/dt in free flight for each constraint (thesis, eq. 2.29).

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
    """Return the unit direction D of the impulse for each constraint.

    The result is exact if the normal velocity is zero: R(x) - x = W v vanishes with v,
    so W follows from its derivative along the gradient of v.

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
        # only the direction matters, because its length is fixed by v_x D = 1
        rows.append(moved / jnp.sum(gradient[k] * moved))
    return jnp.stack(rows)


def force_directions(system, t, x) -> Float[Array, "m n"]:
    """Return the changes of the rates by unit contact forces, friction included."""
    directions = normal_directions(system, t, x)
    if not has_friction(system):
        return directions
    return directions + friction_of(system, t, x)


def contact_multipliers(system, t, x, contact: Bool[Array, " m"]) -> Float[Array, " m"]:
    """Return q with F_s = F - sum q_k D_k over the constraints in contact, where the
    D_k include friction.

    With one constraint without friction, q = a. The contact force is compressive while
    q < 0, and the contact ends when q rises through zero. For constraints that are not
    in contact, q is zero.
    """
    acceleration = normal_acceleration(system, t, x)
    if acceleration.shape[0] == 1 and not has_friction(system):
        return jnp.where(contact, acceleration, jnp.zeros_like(acceleration))
    directions = force_directions(system, t, x)
    gradient = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    return solve_masked(gradient @ directions.T, acceleration, contact)


def field_in_force(system, t, x, contact: Bool[Array, " m"]) -> State:
    """Return the field of free flight, or of sticking on the constraints in `contact`.

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.
        contact: Which constraints are in contact, shape `(m,)`.

    Returns:
        Rates of the state, shape `(n,)` (thesis, eq. 2.30).

    Examples:
        >>> from jaxcam.hybrid.surface import field_in_force
        >>> from jaxcam.models import BouncingBall
        >>> ball, held = BouncingBall(), jnp.array([True])
        >>> field_in_force(ball, 0.0, jnp.zeros(2), held).tolist()
        [0.0, 0.0]
    """
    if not contact.shape[0]:
        return system.vector_field(t, x)
    multipliers = contact_multipliers(system, t, x, contact)
    directions = force_directions(system, t, x)
    push = jnp.sum(multipliers[:, None] * directions, axis=0)
    return system.vector_field(t, x) - push


def sticking_field(system: HybridSystem, t: RealScalar, x: State) -> State:
    """Return the field of sustained contact with every constraint.

    Args:
        system: The system.
        t: Time (s).
        x: State on the surface, shape `(n,)`.

    Returns:
        Rates of the state, shape `(n,)` (thesis, eqs. 2.30 and 2.31).

    Examples:
        >>> from jaxcam.hybrid.surface import sticking_field
        >>> from jaxcam.models import BouncingBall
        >>> sticking_field(BouncingBall(), 0.0, jnp.zeros(2)).tolist()
        [0.0, 0.0]
    """
    everywhere = jnp.ones(gaps(system, t, x).shape, dtype=bool)
    return field_in_force(system, t, x, everywhere)


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


def mode_jet(system, t, x, contact: Bool[Array, " m"]) -> Float[Array, "m 4"]:
    """Return H, v, a and j of each gap along the active field.

    For a constraint in contact, a and j are the multiplier q and its rate; the zero of
    q is the release.
    """

    def field(s, y):
        return field_in_force(system, s, y, contact)

    def multiplier(s, y):
        return contact_multipliers(system, s, y, contact)

    return jet_along(system, t, x, contact, field, multiplier)


def jet_along(system, t, x, contact, field: Callable, multiplier: Callable):
    """Return the jets of `mode_jet` along a field, with the multipliers of contacts."""
    if not contact.shape[0]:
        return jnp.zeros((0, 4))

    def gap(s, y):
        return gaps(system, s, y)

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
