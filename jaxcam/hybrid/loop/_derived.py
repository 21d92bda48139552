"""Functions of a system that only the loop needs, of arrays."""

import jax
import jax.numpy as jnp

from ..surface import (
    free_jet,
    lie_series,
    normal_acceleration,
    normal_directions,
)


def planar_jet(system, t, x, contact):
    """Return the free jet; in contact, the rate of the normal acceleration `a` along
    the sticking motion is `j - C a`, with the jerk `j`.
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
