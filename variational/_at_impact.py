"""A state that is just before or just after an impact."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import (
    HybridSystem,
    normal_acceleration,
    normal_directions,
    normal_velocity,
    restitution_coefficients,
)


class Start(NamedTuple):
    """The impact that an orbit starts at."""

    constraint: int
    #: (n,) state just before it
    before: np.ndarray
    #: s, within which an impact of the same constraint is the same one
    window: float


def start_at_impact(system: HybridSystem, t, state) -> Start | None:
    """The impact at `state`, or nothing where no constraint is touched with a speed.

    **Raises:** `ValueError` for a state after an impact that leaves no speed, which
    does not say how fast it was.
    """
    # as an array: a number would be compiled in
    t = jnp.asarray(t, dtype=jnp.float64)
    gap, speed, fall = map(np.asarray, _look(system, t, state))
    tiny = 1e-12 * (1 + float(np.max(np.abs(state))))
    touching = np.flatnonzero((np.abs(gap) <= tiny) & (np.abs(speed) > tiny))
    if not len(touching):
        return None
    side = int(touching[0])
    before = np.asarray(state)
    if speed[side] > 0:
        before, left = map(np.asarray, _before(system, t, state, side))
        if not left <= 1e-10 * (1 + np.max(np.abs(before))):
            raise ValueError(
                "the state before this impact cannot be found from the one after it; "
                "give the state before the impact, or one in flight"
            )
    pulled = float(np.abs(fall[side]))
    slow = abs(float(speed[side]))
    return Start(side, before, slow / pulled if pulled > 0 else np.inf)


@eqx.filter_jit
def _look(system, t, state):
    return (
        jnp.atleast_1d(system.gap(t, state)),
        normal_velocity(system, t, state),
        normal_acceleration(system, t, state),
    )


@eqx.filter_jit
def _before(system, t, after, side):
    """The state that the impact law takes to `after`, by Newton's method."""

    def law(x):
        return jnp.atleast_2d(system.impact(t, x))[side]

    speed = normal_velocity(system, t, after)[side]
    direction = normal_directions(system, t, after)[side]
    restitution = restitution_coefficients(system, t, after)[side]
    rebound = jnp.where(restitution > 0, speed / restitution, speed)
    guess = after - (speed + rebound) * direction

    def newton(_, x):
        return x - jnp.linalg.solve(jax.jacfwd(law)(x), law(x) - after)

    found = jax.lax.fori_loop(0, 8, newton, guess)
    return found, jnp.max(jnp.abs(law(found) - after))


@eqx.filter_jit
def after_and_speeds(system, time, before, sides):
    """States after impacts, and normal velocities before and after."""

    def one(t, x, side):
        after = jnp.atleast_2d(system.impact(t, x))[side]
        return (
            after,
            normal_velocity(system, t, x)[side],
            normal_velocity(system, t, after)[side],
        )

    return jax.vmap(one)(jnp.asarray(time), jnp.asarray(before), jnp.asarray(sides))
