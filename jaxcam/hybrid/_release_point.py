"""The motion that leaves the constraint after sticking: where every orbit with complete
chattering starts its turn."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._functions import Functions
from ._system import HybridSystem
from ._types import RealScalar


_ON = (True,)


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
    return _contact(Functions(system, guess.shape[0]), jnp.asarray(times), guess)[0]


def contact_acceleration(system: HybridSystem, times, guess) -> Float[Array, " times"]:
    """Normal acceleration that contact suppresses at each of `times`; it holds below 0.

    The follower detaches where its maximum over the period is positive.
    """
    return _contact(Functions(system, guess.shape[0]), jnp.asarray(times), guess)[1]


def _contact(functions: Functions, times, guess):
    """States and accelerations of contact: twelve steps of Newton at each time."""

    def one(t):
        def newton(_, carry):
            x, _ = carry
            jets = functions.jets(t, x, _ON)
            x = functions.onto(functions.frame(t, x), jets, x, _ON)
            return x, jets[0].acceleration

        start = tuple(guess[i] for i in range(guess.shape[0]))
        x, acceleration = jax.lax.fori_loop(0, 12, newton, (start, jnp.zeros_like(t)))
        return jnp.stack(x), acceleration

    return jax.vmap(one)(times)


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
    functions = Functions(system, 2)
    guess = jnp.zeros(2) if guess is None else guess
    t = jnp.asarray(t, dtype=jnp.float64)
    grid = t - system.period * jnp.linspace(1.0, 0.0, samples + 1)
    states, values = _contact(functions, grid, guess)
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
        jets = functions.jets(time, x, _ON)
        slope = jnp.where(jets[0].jerk > 0, jets[0].jerk, jnp.inf)
        moved = jnp.clip(time - jets[0].acceleration / slope, low, high)
        x = functions.onto(functions.frame(time, x), jets, x, _ON)
        return jnp.where(held, t, moved), x

    first = jnp.where(held, t, start)
    from_grid = jnp.where(held, states[-1], states[last])
    time, x = jax.lax.fori_loop(0, 16, newton, (first, (from_grid[0], from_grid[1])))
    never = ~held & ~jnp.any(rises)
    holds = jnp.where(never, 2.0, jnp.where(held, 1.0, 0.0))
    return ReleasePoint(time, jnp.stack(x), holds)
