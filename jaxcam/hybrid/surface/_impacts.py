"""Impacts at the constraints, with Coulomb friction."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._contact_friction import (
    friction_on,
    has_friction,
    restitution_kind,
    sides_of,
    surfaces_of,
)
from ._frictional_impact import impulses, Rates
from ._normal import normal_directions, normal_velocity


# approach velocities below this fraction of the terms of a normal velocity count as
# rounding errors of a constraint at rest
_SLOW = 1e-8


def impacts(system: HybridSystem, t: RealScalar, x: State) -> Float[Array, "m n"]:
    """Return the state after an impact at each constraint, including friction, with one
    row per constraint.

    Args:
        system: The system.
        t: Time (s).
        x: State just before the impact, shape `(n,)`.

    Returns:
        States after the impact, shape `(m, n)`.

    Examples:
        >>> from jaxcam.hybrid.surface import impacts
        >>> from jaxcam.models import BouncingBall
        >>> impacts(BouncingBall(), 0.0, jnp.array([0.0, -1.0])).tolist()
        [[0.0, 0.8]]
    """
    after = jnp.atleast_2d(system.impact(t, x))
    if not has_friction(system):
        return after
    return _with_friction(system, t, x, after)


class FrictionlessLaw(NamedTuple):
    """The law of impacts without friction at a state, for each constraint."""

    velocities: Float[Array, " m"]
    """Normal velocities."""
    slope: Float[Array, "m n"]
    """Their derivatives with respect to the state."""
    directions: Float[Array, "m n"]
    """Unit directions of the impulses."""
    coefficients: Float[Array, " m"]
    """Coefficients of restitution."""


def frictionless_law(system: HybridSystem, t: RealScalar, x: State) -> FrictionlessLaw:
    """Return the directions and coefficients of impacts without friction at a state.

    Args:
        system: The system.
        t: Time (s).
        x: State just before an impact, shape `(n,)`.

    Returns:
        The law; for a constraint that is not approached, to within rounding, the
            direction and the coefficient are those in the limit of slow impacts.
    """
    after = jnp.atleast_2d(system.impact(t, x))
    before = normal_velocity(system, t, x)
    slope = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    slow = _SLOW * jnp.abs(slope) @ jnp.abs(x)
    return FrictionlessLaw(before, slope, *_law(system, t, x, before, after, slow))


def restitution_coefficients(system, t, x) -> Float[Array, " m"]:
    """Return the coefficient of restitution of each constraint in the limit of slow
    impacts.

    Args:
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`.

    Returns:
        Coefficients of restitution, shape `(m,)`.

    Examples:
        >>> from jaxcam.hybrid.surface import restitution_coefficients
        >>> from jaxcam.models import BouncingBall
        >>> r = restitution_coefficients(BouncingBall(), 0.0, jnp.zeros(2))
        >>> round(float(r[0]), 6)
        0.8
    """
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


def _with_friction(
    system: HybridSystem, t: RealScalar, x: State, after: Float[Array, "m n"]
) -> Float[Array, "m n"]:
    """Return the states after impacts with friction, from those `after` frictionless
    impacts.
    """
    sides, kind = sides_of(system, t, x), restitution_kind(system)
    before = normal_velocity(system, t, x)
    directions, coefficients = _law(system, t, x, before, after, 0 * before)
    rows = []
    for k, direction in enumerate(directions):
        one = contact_at(system, t, x, k, sides, direction)
        found = impulses(
            one.side, one.slip, before[k], coefficients[k], one.rates, kind
        )
        friction = found.positive * one.positive + found.negative * one.negative
        rows.append(x + found.total * direction + friction)
    return jnp.stack(rows)


def _law(system, t, x, before, after, slow):
    """Return the directions and coefficients of frictionless impacts.

    At approach velocities up to `slow`, those in the limit of slow impacts are returned
    instead.
    """
    limits = normal_directions(system, t, x)
    directions, coefficients = [], []
    for k, row in enumerate(after):
        approach, rebound = before[k], normal_velocity(system, t, row)[k]
        moves = approach < -slow[k]
        impulse = jnp.where(moves, rebound - approach, 1.0)
        direction = jnp.where(moves, (row - x) / impulse, limits[k])
        coefficient = jnp.where(
            moves,
            -rebound / jnp.where(moves, approach, -1.0),
            _slow_coefficient(system, t, x, k, direction),
        )
        directions.append(direction)
        coefficients.append(coefficient)
    return jnp.stack(directions), jnp.stack(coefficients)


def _slow_coefficient(system, t, x, k: int, direction):
    """Return the frictionless coefficient in the limit of slow impacts."""

    def frictionless(y):
        return normal_velocity(system, t, jnp.atleast_2d(system.impact(t, y))[k])[k]

    return -jax.jvp(frictionless, (x,), (direction,))[1]


class Contact(NamedTuple):
    """The slip at one contact: its sign, magnitude and switching function (an index);
    the friction during positive and negative slip, `(n,)`; and the `Rates`.
    """

    side: Any
    slip: Any
    surface: Any
    positive: State
    negative: State
    rates: Rates


def contact_at(system, t, x, k: int, sides, direction) -> Contact:
    """Return the slip and friction of constraint `k`.

    The slip is the switching function on which the friction depends.
    """
    same = friction_on(system, t, x, sides)[k]
    # if the friction depends on no switching function, the slip never ends
    found: tuple = jnp.asarray(1.0), jnp.asarray(jnp.inf), same, same
    place = jnp.asarray(0)
    for j in reversed(range(len(sides))):
        both = [
            friction_on(system, t, x, sides.at[j].set(side))[k] for side in (1.0, -1.0)
        ]
        depends = jnp.any(both[0] != both[1])
        slip = jnp.maximum(sides[j] * surfaces_of(system, t, x)[j], 0.0)
        mine = sides[j], slip, *both
        found = tuple(jnp.where(depends, a, b) for a, b in zip(mine, found))
        place = jnp.where(depends, j, place)

    def velocities(y):
        slips = surfaces_of(system, t, y)
        return slips[place], normal_velocity(system, t, y)[k]

    side, slip, positive, negative = found
    rates = Rates(
        *(
            jax.jvp(velocities, (x,), (direction + part,))[1]
            for part in (positive, negative)
        )
    )
    return Contact(side, slip, place, positive, negative, rates)
