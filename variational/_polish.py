"""The impacts of a periodic orbit, as accurate as the parameters allow.

A run that looks for its impacts loses digits where they are slow: an error d of the
position changes an impact speed v by about a d / v. As the solution of a boundary value
problem the impacts are as well conditioned as the orbit itself, whatever their speed:
the unknowns are the times and states of all impacts, the equations that each flight
ends at the next of them, and that the gap is zero there (multiple shooting).
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jaxcam.hybrid import HybridSystem

from ._event_law import gap_of, impact_of
from ._flight import fly


# of Newton's method, which starts from a run that has almost closed
_STEPS = 4


class Knots(NamedTuple):
    """The impacts of a turn in order, and how well flights join them."""

    time: Float[np.ndarray, " k"]
    #: (k, n) state just before
    before: Float[np.ndarray, "k n"]
    #: largest miss of a flight before the first and after the last step
    miss: float
    left: float


def polish(
    system: HybridSystem,
    time: Float[np.ndarray, " k"],
    before: Float[np.ndarray, "k n"],
    constraint: Int[np.ndarray, " k"],
    period,
) -> Knots:
    """Improve the impacts of an orbit without contact; unchanged where that fails."""
    number, n = before.shape
    length = 1
    while length < number:
        length *= 2
    spare = length - number
    times = np.concatenate([time, np.full(spare, time[-1])])
    states = np.concatenate([before, np.broadcast_to(before[-1], (spare, n))])
    sides = np.concatenate([constraint, np.full(spare, constraint[-1])])
    real = np.arange(length) < number
    following = np.where(real, (np.arange(length) + 1) % number, np.arange(length))
    # as an array: a number would be compiled in
    span = np.asarray(period, dtype=float)
    made = _newton(system, times, states, sides, real, following, span)
    new_times, new_states, first, last = map(np.asarray, made)
    if np.isfinite(last) and last <= first:
        time, before = new_times[:number], new_states[:number]
    return Knots(time, before, float(first), float(min(first, last)))


@eqx.filter_jit
def _newton(system, times, states, sides, real, following, period):
    system = system.prepared()
    autonomous = system.period is None
    number, n = states.shape
    identity = jnp.eye(n)
    # the last real knot is followed by the first one, a period later
    wraps = jnp.where(following <= jnp.arange(number), period, 0.0)
    wraps = jnp.where(real, wraps, 0.0)

    def one(t, x, side, t_next, x_next, is_real):
        law, gap = impact_of(system, side), gap_of(system, side)
        after, law_t = jax.jvp(lambda s: law(s, x), (t,), (jnp.ones_like(t),))
        law_x = jax.jacfwd(law, argnums=1)(t, x)
        flight = fly(
            lambda _, s, y: system.vector_field(s, y),
            jnp.zeros(0),
            t,
            after,
            jnp.where(is_real, t_next, t),
        )
        height, (height_t, height_x) = jax.value_and_grad(gap, argnums=(0, 1))(t, x)
        by_t = -flight.matrix @ (law_t - system.vector_field(t, after))
        rate = system.vector_field(t_next, flight.state)
        miss = jnp.append(x_next - flight.state, height)
        own = jnp.zeros((n + 1, n + 1))
        own = own.at[:n, 0].set(by_t).at[:n, 1:].set(-flight.matrix @ law_x)
        own = own.at[n, 0].set(height_t).at[n, 1:].set(height_x)
        other = jnp.zeros((n + 1, n + 1))
        other = other.at[:n, 0].set(-rate).at[:n, 1:].set(identity)
        # a knot that is only there to fill up stays where it is
        return (
            jnp.where(is_real, miss, 0.0),
            jnp.where(is_real, own, jnp.eye(n + 1)),
            jnp.where(is_real, other, 0.0),
        )

    def linear(times, states):
        return jax.vmap(one)(
            times, states, sides, times[following] + wraps, states[following], real
        )

    def newton(_, carry):
        times, states = carry
        miss, own, other = linear(times, states)
        index = jnp.arange(number)
        matrix = jnp.zeros((number, number, n + 1, n + 1))
        matrix = matrix.at[index, index].add(own).at[index, following].add(other)
        flat = matrix.transpose(0, 2, 1, 3).reshape(number * (n + 1), -1)
        if autonomous:
            # any shift in time solves it: the smallest change is taken
            step = jnp.linalg.lstsq(flat, miss.ravel())[0]
        else:
            step = jnp.linalg.solve(flat, miss.ravel())
        step = step.reshape(number, n + 1)
        return times - step[:, 0], states - step[:, 1:]

    first = jnp.max(jnp.abs(linear(times, states)[0]))
    start = (jnp.asarray(times), jnp.asarray(states))
    times, states = jax.lax.fori_loop(0, _STEPS, newton, start)
    last = jnp.max(jnp.abs(linear(times, states)[0]))
    return times, states, first, last
