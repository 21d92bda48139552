"""Find whether a state is just before or just after an impact."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import gaps, impacts, normal_acceleration, normal_velocity

from ._gap_sizes import gap_sizes


# rounding error of a zero gap or speed, relative to its scale
_ZERO = 1e-11


class ImpactStart(NamedTuple):
    """The impact at the start of an orbit."""

    constraint: int
    after: np.ndarray
    """State just after the impact, (n,)."""
    window: float
    """Time (s) within which an impact at the same constraint is the same impact."""


def start_at_impact(system: HybridSystem, t, state, period) -> ImpactStart | None:
    """Return the impact at `state`, or None if no constraint is touched with a nonzero
    speed.
    """
    # pass arrays, because numbers would be compiled into the program
    t, period = (jnp.asarray(x, dtype=jnp.float64) for x in (t, period))
    gap, speed, fall, after, size = map(np.asarray, _look(system, t, state, period))
    closed = np.abs(gap) <= _ZERO * size
    moves = np.abs(speed) > _ZERO * size * 2 * np.pi / float(period)
    touching = np.flatnonzero(closed & moves)
    if not len(touching):
        return None
    side = int(touching[0])
    state = np.asarray(state)
    pulled = float(np.abs(fall[side]))
    slow = abs(float(speed[side]))
    window = slow / pulled if pulled > 0 else np.inf
    return ImpactStart(side, state if speed[side] > 0 else after[side], window)


@program
def _look(system, t, state, period):
    return (
        gaps(system, t, state),
        normal_velocity(system, t, state),
        normal_acceleration(system, t, state),
        impacts(system, t, state),
        gap_sizes(system, t, state, period),
    )


@program
def after_and_speeds(system, time, before, sides):
    """Return the states after impacts, and the normal velocities before and after."""

    def one(t, x, side):
        after = impacts(system, t, x)[side]
        return (
            after,
            normal_velocity(system, t, x)[side],
            normal_velocity(system, t, after)[side],
        )

    return jax.vmap(one)(jnp.asarray(time), jnp.asarray(before), jnp.asarray(sides))
