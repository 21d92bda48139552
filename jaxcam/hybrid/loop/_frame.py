"""Directions in which a state is moved back onto the surfaces of constraints."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from ..surface import gaps, normal_directions, normal_velocity


class Frame(NamedTuple):
    """For m constraints, the directions in which a state is moved, and the effects of
    these displacements.

    - `lift`, `push`: for each constraint, the direction E in which its gap changes by
        one, and the direction D in which its normal velocity changes by one.
    - `raised`, `hurried`: the changes of all gaps and of all normal velocities (rows)
        by each E (columns).
    - `pushed`: the changes of all normal velocities by each D.
    """

    lift: tuple
    push: tuple
    raised: tuple
    hurried: tuple
    pushed: tuple


def frame_of(system, t, x):
    """Return the arrays of a `Frame`: two of shape `(m, n)`, and three of `(m, m)`."""
    gradient = jax.jacfwd(lambda y: gaps(system, t, y))(x)
    slope = jax.jacfwd(lambda y: normal_velocity(system, t, y))(x)
    lift, push = lift_of(system, t, x), normal_directions(system, t, x)
    return lift, push, gradient @ lift.T, slope @ lift.T, slope @ push.T


def lift_of(system, t, x):
    """Return, for each gap, the displacement of the state that increases it by one, to
    first order; zero for a gap that does not depend on the state.
    """
    gradient = jax.jacfwd(lambda y: gaps(system, t, y))(x)
    square = jnp.sum(gradient * gradient, axis=1)[:, None]
    return gradient / jnp.where(square > 0, square, 1.0)


def lift_and_remainder(system, t, x):
    """Return `lift_of`, and what is left of each gap after the displacement that would
    close it if it were linear; unlimited for a gap that does not depend on the state.
    """
    lift, present = lift_of(system, t, x), gaps(system, t, x)
    left = [
        jnp.where(jnp.any(row != 0), gaps(system, t, x - gap * row)[k], jnp.inf)
        for k, (row, gap) in enumerate(zip(lift, present, strict=True))
    ]
    return lift, jnp.stack(left)
