"""Directions in which a state is moved back onto the surface of a constraint."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from ..surface import gaps, normal_acceleration, normal_directions, normal_velocity


class Frame(NamedTuple):
    """Directions used to move a state back onto the surface; see `Functions.onto`."""

    lift: tuple
    push: tuple
    lift_velocity: tuple
    damping: tuple


def frame_of(system, t, x):
    """Return, for each constraint, the direction E in which the gap changes by one, the
    direction D in which the normal velocity v changes by one, and the products v_x E
    and C = a_x D, where a is the normal acceleration.
    """
    slope = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    curve = jax.jacfwd(lambda y: normal_acceleration(system, t, y))(x)
    push = normal_directions(system, t, x)
    lift = lift_of(system, t, x)
    return lift, push, jnp.sum(slope * lift, axis=1), jnp.sum(curve * push, axis=1)


def lift_of(system, t, x):
    """Return, for each gap, the displacement of the state that increases it by one."""
    gradient = jax.jacfwd(lambda y: gaps(system, t, y))(x)
    return gradient / jnp.sum(gradient * gradient, axis=1)[:, None]
