"""The motion that leaves the constraint after sticking: where every orbit with complete
chattering starts its turn."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._system import HybridSystem
from .._types import RealScalar, State
from ._normal import free_jet, gaps, normal_acceleration, normal_velocity


class ReleasePoint(eqx.Module):
    """`time` (s) and `state` `(n,)` at which contact ends.

    `holds`: 0 for a release, 1 where contact still holds, 2 where there is none.
    """

    time: Float[Array, ""]
    state: Float[Array, " n"]
    holds: Float[Array, ""]


def contact_state(system: HybridSystem, times, guess) -> Float[Array, "times n"]:
    """State of sustained contact at each of `times`, for two states and one constraint.

    Gap and normal velocity zero fix it; found by Newton from `guess`, shape `(n,)`.
    """
    return _contact(system, jnp.asarray(times), guess)[0]


def contact_acceleration(system: HybridSystem, times, guess) -> Float[Array, " times"]:
    """Normal acceleration that contact suppresses at each of `times`; it holds below 0.

    The follower detaches where its maximum over the period is positive.
    """
    return _contact(system, jnp.asarray(times), guess)[1]


def _contact(system: HybridSystem, times, guess):
    """States and accelerations of contact: twelve steps of Newton at each time."""

    def one(t):
        x = jax.lax.fori_loop(0, 12, lambda _, x: _onto(system, t, x), guess)
        return x, normal_acceleration(system, t, x)[0]

    return jax.vmap(one)(times)


def _onto(system: HybridSystem, t: RealScalar, x: State) -> State:
    """One Newton step of the two states onto gap = normal velocity = 0."""

    def both(y):
        return gaps(system, t, y)[0], normal_velocity(system, t, y)[0]

    gap, velocity = both(x)
    (a, b), (c, d) = jax.jacfwd(both)(x)
    step = jnp.stack([d * gap - b * velocity, a * velocity - c * gap])
    return x - step / (a * d - b * c)


def release_point(
    system: HybridSystem, t: RealScalar, guess=None, samples: int = 512
) -> ReleasePoint:
    """The last release at or before `t`, found by a scan over one period.

    **Arguments:** a system with a `period`, two states and one constraint; a state near
    the surface for Newton's method (zeros by default); points in the scan.

    **Returns:** the release, or, where contact holds at `t`, the state of contact at
    `t` with `holds` 1. `holds` is 2 where there is no contact at all in a period.
    """
    system = system.prepared()
    guess = jnp.zeros(2) if guess is None else guess
    t = jnp.asarray(t, dtype=jnp.float64)
    grid = t - system.period * jnp.linspace(1.0, 0.0, samples + 1)
    states, values = _contact(system, grid, guess)
    held = values[-1] < 0
    rises = (values[:-1] < 0) & (values[1:] >= 0)
    last = jnp.where(jnp.any(rises), samples - 1 - jnp.argmax(rises[::-1]), 0)
    low, high = grid[last], grid[last + 1]
    # the chord is close enough for Newton, which also carries the derivative
    rise = values[last + 1] - values[last]
    share = -values[last] / jnp.where(rises[last], rise, 1.0)
    start = jax.lax.stop_gradient(low + share * (high - low))

    def newton(_, carry):
        time, x = carry
        _, _, acceleration, jerk = free_jet(system, time, x)[0]
        slope = jnp.where(jerk > 0, jerk, jnp.inf)
        moved = jnp.clip(time - acceleration / slope, low, high)
        return jnp.where(held, t, moved), _onto(system, time, x)

    first = jnp.where(held, t, start)
    from_grid = jnp.where(held, states[-1], states[last])
    time, x = jax.lax.fori_loop(0, 16, newton, (first, from_grid))
    never = ~held & ~jnp.any(rises)
    holds = jnp.where(never, 2.0, jnp.where(held, 1.0, 0.0))
    return ReleasePoint(time, x, holds)
