"""Estimate the rounding errors of gaps and normal velocities, and detect contact at the
start.
"""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._normal import gaps, normal_acceleration, normal_velocity


def gap_rounding(
    system: HybridSystem, t: RealScalar, x: State, reach: State
) -> Float[Array, " m"]:
    """Return the rounding error of each gap, for components as large as `reach`."""
    return rounding_of(lambda s, y: gaps(system, s, y), t, x, reach)


def speed_rounding(
    system: HybridSystem, t: RealScalar, x: State, reach: State
) -> Float[Array, " m"]:
    """Return the rounding error of each normal velocity."""
    return rounding_of(lambda s, y: normal_velocity(system, s, y), t, x, reach)


def start_room(rounding, acceleration, time):
    """Return the distance or speed up to which a start counts as in contact.

    **Arguments:** the rounding error; the normal acceleration; and the time for which
    it acts (s), squared for a distance. For a start at the origin of a coordinate, the
    forced motion provides the only scale.
    """
    return 500 * rounding + 1e-12 * jnp.abs(acceleration) * time


def forced_time(period):
    """Return the period over 2 pi (s), or zero for a period of `None` or inf."""
    if period is None:
        return jnp.zeros(())
    return jnp.where(jnp.isfinite(period), period / (2 * jnp.pi), 0.0)


def least_gaps(system, t, x, room: RealScalar = 1.0) -> Float[Array, " m"]:
    """Return the gaps of a start plus `room` times their resolution.

    A start penetrates no constraint if none of these sums is negative.
    """
    rounding = gap_rounding(system, t, x, jnp.abs(x))
    acceleration = normal_acceleration(system, t, x)
    time = forced_time(system.period) ** 2
    return gaps(system, t, x) + room * start_room(rounding, acceleration, time)


def rounding_of(function: Callable, t, x, reach):
    """Return the error of a function that is due to the rounding of `t` and `x`.

    State components are accurate to a few parts in 1e15; a time, and a phase computed
    from it, to two parts in 1e16 each.
    """
    by_state = jax.jacfwd(lambda y: function(t, y))(x)
    by_time = jax.jvp(lambda s: function(s, x), (t,), (jnp.ones_like(t),))[1]
    size = jnp.sum(jnp.abs(by_state) * reach[None], axis=1)
    return 2e-15 * size + 4e-16 * jnp.abs(t * by_time)
