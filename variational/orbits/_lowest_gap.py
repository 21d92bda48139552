"""Find the lowest gap within a flight, where an orbit may graze or penetrate."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.surface import gaps, normal_acceleration, normal_velocity

from ._flight import flight_end, flight_nodes


# number of bisections to find the lowest point of a polynomial, as a start for Newton's
# method
_HALVINGS = 20


def nodes_of(system: HybridSystem, start, end, steps: int):
    """Return times and states at the ends of all steps of a flight, and its error."""
    later, states, wrong = flight_nodes(system, start[0], start[1:], end, steps)
    times = jnp.concatenate([start[:1], later])
    return times, jnp.concatenate([start[None, 1:], states]), wrong


def lowest_times(
    system: HybridSystem, start, end, steps: int, whole_turn: bool = False, nodes=None
) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
    """Return the time and value of the lowest minimum of each gap within a flight.

    At a minimum, the normal velocity rises through zero; the ends of the flight, which
    are on the constraint, do not count. With `whole_turn`, the flight is a closed
    orbit, and its lowest point counts wherever it is.

    **Arguments:** time and state `(1 + n,)` at the start, time at the end (s); `nodes`
    of the flight, if they are known.

    Returns:
        Times (s) and gaps, one for each constraint; if a gap has no minimum, the end of
            the flight and the largest gap in it.
    """
    t0 = start[0]
    nodes = nodes_of(system, start, end, steps) if nodes is None else nodes
    times, states, _ = nodes
    heights = jax.vmap(lambda t, x: gaps(system, t, x))(times, states)
    speeds = jax.vmap(lambda t, x: normal_velocity(system, t, x))(times, states)
    pushes = jax.vmap(lambda t, x: normal_acceleration(system, t, x))(times, states)
    h = (end - t0) / steps
    share, depth, turns = _rise(speeds, h * pushes)
    value = jnp.where(turns, heights[:-1] + h * depth, jnp.inf)
    if whole_turn:
        at_nodes = jnp.where(turns, value, heights[:-1])
        chosen = jnp.argmin(at_nodes, axis=0)
        exists = jnp.ones(heights.shape[1], dtype=bool)
        share = jnp.where(turns, share, 0.0)
    else:
        chosen = jnp.argmin(value, axis=0)
        exists = jnp.any(turns, axis=0)

    def polish(which):
        k = chosen[which]
        node_t, node_x = times[k], states[k]

        def newton(_, found):
            # the gap is that before the last change of s, which is only rounding
            s, _ = found
            x = flight_nodes(system, node_t, node_x, node_t + s, 1)[1][-1]
            v = normal_velocity(system, node_t + s, x)[which]
            a = normal_acceleration(system, node_t + s, x)[which]
            better = jnp.clip(s - v / jnp.where(a > 0, a, jnp.inf), -h, 2 * h)
            return better, gaps(system, node_t + s, x)[which]

        first = (share[k, which] * h, jnp.zeros_like(h))
        s, there = jax.lax.fori_loop(0, 5, newton, first)
        high = jnp.max(heights[:, which])
        return (
            jnp.where(exists[which], node_t + s, end),
            jnp.where(exists[which], there, high),
        )

    return jax.vmap(polish)(jnp.arange(heights.shape[1]))


def gap_or_speed(
    system: HybridSystem,
    starts: Float[Array, "m row"],
    ends: Float[Array, " m"],
    number: Int[Array, ""],
    hit: Int[Array, " m"] | None,
    steps: int,
    count,
) -> Float[Array, ""]:
    """Return the lowest gap of flight `number`, or, for `number` >= `count`, the
    approach speed of impact `number` - `count`, where `count` is the number of flights
    without padding.

    One integration is used for both, so one small program is sufficient. The result is
    differentiable: the time of a minimum has no first-order effect, so the derivative
    is that of the gap at a fixed time. `hit` are the constraints at which the flights
    end, or None for a closed orbit without impacts.
    """
    landed = number >= count
    # flight k ends in impact k + 1
    k = jnp.where(landed, number - 1, number) % count
    start, end = starts[k], ends[k]
    still = jax.lax.stop_gradient((system, start, end))
    times, heights = lowest_times(*still, steps, whole_turn=hit is None)
    lowest = jnp.argmin(heights)
    turns = times[lowest] < still[2]
    if hit is None:
        x = flight_end(system, start[0], start[1:], times[lowest], steps=steps)
        return gaps(system, times[lowest], x)[lowest]
    time = jnp.where(~landed & turns, times[lowest], end)
    x = flight_end(system, start[0], start[1:], time, steps=steps)
    gap = jnp.where(turns, gaps(system, time, x)[lowest], heights[lowest])
    return jnp.where(landed, -normal_velocity(system, time, x)[hit[k]], gap)


def _rise(speeds, changes):
    """Return where a velocity rises through zero in each step, from the cubic that
    matches the velocity and its rate at both ends.

    A fall and a rise within the same step are included, because a low flight may be
    shorter than a step.

    Returns:
        The fraction of the step at which the rise occurs, the distance covered up to
            that point divided by the duration of the step, and whether there is such a
            rise; `(steps, m)` each.
    """
    a, b = speeds[:-1], speeds[1:]
    p, q = changes[:-1], changes[1:]
    second, third = 3 * (b - a) - 2 * p - q, p + q - 2 * (b - a)

    def velocity(s):
        return a + s * (p + s * (second + s * third))

    # where the cubic is lowest, if not at the start
    root = jnp.sqrt(jnp.maximum(second * second - 3 * third * p, 0.0))
    below = second + root
    bottom = jnp.where(below > 0, -p / jnp.where(below > 0, below, 1.0), 0.0)
    bottom = jnp.clip(bottom, 0.0, 1.0)
    low = jnp.where(velocity(bottom) < a, bottom, 0.0)
    turns = (velocity(low) < 0) & (b >= 0)

    def halve(_, ends):
        low, high = ends
        middle = (low + high) / 2
        falls = velocity(middle) < 0
        return jnp.where(falls, middle, low), jnp.where(falls, high, middle)

    low, high = jax.lax.fori_loop(0, _HALVINGS, halve, (low, jnp.ones_like(low)))
    s = jnp.where(turns, (low + high) / 2, 0.0)
    way = s * (a + s * (p / 2 + s * (second / 3 + s * third / 4)))
    return s, way, turns
