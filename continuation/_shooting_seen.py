"""What is seen of an impacting orbit, from one integration of its flights."""

from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ._admissible import DIP, IMPACT
from ._lowest_gap import lowest_times, nodes_of
from ._shooting_flight import flight_nodes


if TYPE_CHECKING:
    from ._shooting import ImpactingOrbits


def monitors_and_observed(problem: "ImpactingOrbits", u, parameters):
    """The monitors, and the observed quantities: two dictionaries of arrays."""
    starts, ends = problem.flights(u, parameters)
    whole = not problem.constraints

    def one(start, end):
        nodes = nodes_of(parameters, start, end, problem.steps)
        gap = lowest_times(parameters, start, end, problem.steps, whole, nodes)[1]
        return *nodes, jnp.min(gap)

    times, states, wrong, lowest = jax.vmap(one)(starts, ends)
    monitors = {f"{DIP} {k}": lowest[k] for k in range(lowest.shape[0])}
    if problem.constraints:
        speeds = problem.speeds_at(parameters, ends, states[:, -1])
        monitors |= {f"{IMPACT} {k}": speeds[k] for k in range(len(speeds))}
    found = {
        "period": problem.period(u, parameters),
        "time": starts[0, 0],
        "state": starts[0, 1:],
        "integration error": jnp.max(wrong),
    }
    if problem.periods:
        found["stroboscopic"] = _stroboscopic(problem, parameters, times, states)
    return monitors, found


def _stroboscopic(
    problem: "ImpactingOrbits", parameters, times, states
) -> Float[Array, "periods n"]:
    """States at time zero and each forcing period after it, from those at the ends of
    all Runge-Kutta steps."""
    base = parameters.period
    length = problem.periods * base

    def at(time):
        ago = jnp.mod(time - times[:, 0], length)
        last = jnp.argmin(ago)
        when = times[last, 0] + ago[last]
        k = jnp.searchsorted(times[last], when, side="right") - 1
        k = jnp.clip(k, 0, problem.steps - 1)
        flown = flight_nodes(parameters, times[last, k], states[last, k], when, 1)
        return flown[1][-1]

    return jax.vmap(at)(base * jnp.arange(problem.periods, dtype=jnp.float64))
