"""Functions of a system that only the event loop needs, written for arrays."""

import jax
import jax.numpy as jnp

from .._switched import SwitchedSystem
from ..lowering import MotionSeries
from ..surface import (
    along_path,
    free_jet,
    InMode,
    Jumps,
    lie_series,
    motion_rates,
    normal_acceleration,
    normal_directions,
)


def planar_jet(system, t, x, contact):
    """Return the jet in free flight; in contact, its jerk `j` is replaced by `j - C a`,
    the rate of the normal acceleration `a` along the sticking motion.
    """
    jet = free_jet(system, t, x)
    direction = normal_directions(system, t, x)[0]
    _, damping = jax.jvp(
        lambda y: normal_acceleration(system, t, y)[0], (x,), (direction,)
    )
    along = jet[0, 3] - damping * jet[0, 2]
    jerk = jnp.where(contact[0], along, jet[0, 3])
    return jnp.stack([jet[0, 0], jet[0, 1], jet[0, 2], jerk])[None]


def free_taylor(system, t, x, contact):
    del contact
    return jnp.stack(lie_series(system.vector_field, system.vector_field, 2)(t, x))


def nested_series(function, t, x, *rest) -> MotionSeries:
    """Return the same series as `motion_series`, by nested derivatives of arrays."""

    def field(s, y):
        return function(s, y, *rest)[0]

    rates = motion_rates(field, t, x)
    along = along_path(lambda s, y: function(s, y, *rest)[1], t, x, rates, 3)
    return MotionSeries(list(rates), list(along))


def in_mode(function, m: int, jumps: Jumps):
    """Convert a `function` of a system to one whose last argument is the mode."""

    def call(system, *arguments):
        *rest, mode = arguments
        k = (mode.shape[0] - m) // 2
        contact, negative, sliding = mode[:m], mode[m : m + k], mode[m + k :]
        return function(InMode(system, negative, sliding, contact, jumps), *rest)

    return call


def negative_sides(system: SwitchedSystem, t, x):
    return system.sides(t, x) < 0
