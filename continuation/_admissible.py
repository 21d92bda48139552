"""Whether an orbit is one: no penetration of a constraint anywhere on it."""

from typing import Any, TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid._normal import gaps, normal_acceleration, normal_velocity

from ._parameter import with_leaf
from ._problem import Start
from ._shooting_flight import flight_end, flight_nodes


if TYPE_CHECKING:
    from ._shooting import ImpactingOrbits


#: names of the monitors: lowest gap within flight k, approach speed of impact k
DIP = "gap of flight"
IMPACT = "speed of impact"
#: a gap below this (relative to the largest of the orbit) is a penetration; it is what
#: rounding and the equations' tolerance leave of a gap of zero
ROUNDING = 1e-9


def nodes_of(system: HybridSystem, start, end, steps: int):
    """Times and states at both ends of all steps of a flight, and its error."""
    later, states, wrong = flight_nodes(system, start[0], start[1:], end, steps)
    times = jnp.concatenate([start[:1], later])
    return times, jnp.concatenate([start[None, 1:], states]), wrong


def lowest_times(
    system: HybridSystem, start, end, steps: int, whole_turn: bool = False, nodes=None
) -> tuple[Float[Array, " m"], Float[Array, " m"]]:
    """When each gap has its lowest minimum within a flight, and the gap there.

    A minimum lies where the normal velocity rises through zero; the ends of the flight,
    where it starts and ends in contact, do not count. With `whole_turn` the flight is a
    closed orbit and its lowest point counts wherever it is.

    **Arguments:** time and state `(1 + n,)` at the start, time at the end (s); `nodes`
    of the flight where they are known.

    **Returns:** times (s) and gaps, one for each constraint; where a gap has no
    minimum, the end of the flight and the largest gap on it.
    """
    t0 = start[0]
    nodes = nodes_of(system, start, end, steps) if nodes is None else nodes
    times, states, _ = nodes
    heights = jax.vmap(lambda t, x: gaps(system, t, x))(times, states)
    speeds = jax.vmap(lambda t, x: normal_velocity(system, t, x))(times, states)
    turns = (speeds[:-1] < 0) & (speeds[1:] >= 0)
    h = (end - t0) / steps
    # the cubic through values and slopes is close enough to choose by
    rise = speeds[1:] - speeds[:-1]
    share = jnp.clip(-speeds[:-1] / jnp.where(rise == 0, 1.0, rise), 0.0, 1.0)
    value = _cubic(heights, speeds, h, share)
    value = jnp.where(turns, value, jnp.inf)
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

        def newton(_, s):
            x = flight_nodes(system, node_t, node_x, node_t + s, 1)[1][-1]
            v = normal_velocity(system, node_t + s, x)[which]
            a = normal_acceleration(system, node_t + s, x)[which]
            return jnp.clip(s - v / jnp.where(a > 0, a, jnp.inf), -h, 2 * h)

        s = jax.lax.fori_loop(0, 4, newton, share[k, which] * h)
        x = flight_nodes(system, node_t, node_x, node_t + s, 1)[1][-1]
        there = gaps(system, node_t + s, x)[which]
        high = jnp.max(heights[:, which])
        return (
            jnp.where(exists[which], node_t + s, end),
            jnp.where(exists[which], there, high),
        )

    return jax.vmap(polish)(jnp.arange(heights.shape[1]))


def dips(
    system: HybridSystem,
    starts: Float[Array, "m row"],
    ends: Float[Array, " m"],
    steps: int,
    whole_turn: bool = False,
) -> Float[Array, " m"]:
    """The lowest gap inside each flight; differentiable.

    At a minimum the time of it does not matter to first order, so its derivative is
    that of the gap at a fixed time.
    """

    def one(start, end):
        still = jax.lax.stop_gradient((system, start, end))
        times, values = lowest_times(*still, steps, whole_turn)
        which = jnp.argmin(values)
        time = times[which]
        x = flight_end(system, start[0], start[1:], time, steps=steps)
        found = time < still[2] if not whole_turn else jnp.asarray(True)
        return jnp.where(found, gaps(system, time, x)[which], values[which])

    return jax.vmap(one)(starts, ends)


def _cubic(heights, speeds, h, s):
    """Cubic Hermite interpolant of each step at the fraction `s` of it."""
    a, b = heights[:-1], heights[1:]
    p, q = h * speeds[:-1], h * speeds[1:]
    rise = b - a
    return a + s * (p + s * (3 * rise - 2 * p - q + s * (p + q - 2 * rise)))


@eqx.filter_jit
def _lowest(problem, u, parameters):
    starts, ends = problem.flights(u, parameters)
    whole = not problem.constraints
    return jax.vmap(
        lambda a, b: lowest_times(parameters, a, b, problem.steps, whole_turn=whole)
    )(starts, ends)


def inadmissible(problem: "ImpactingOrbits", point: Any) -> str | None:
    """Why the orbit at a point is none, or None."""
    return _reason(problem, point.tests, point.observed)


@eqx.filter_jit
def _look(problem, u, parameters):
    return problem.seen(u, parameters)


def refuse(problem: "ImpactingOrbits", u, parameters) -> str | None:
    """Why a solution of the equations is no orbit, or None."""
    return _reason(problem, *_look(problem, jnp.asarray(u), parameters))


def _reason(problem, monitors, observed) -> str | None:
    for name, value in monitors.items():
        value = float(value)
        where = name.rsplit(" ", 1)[-1]
        if name.startswith(IMPACT) and not value >= -ROUNDING:
            return (
                f"impact {where} moves away from its constraint: the orbit would have "
                "to start its flight inside it"
            )
        if name.startswith(DIP) and not value >= -ROUNDING:
            return (
                f"the gap falls to {value:.1e} within flight {where}: the orbit "
                "would go through the constraint"
            )
    wrong = float(observed["integration error"])
    if not wrong < 1e-9:
        return (
            f"{problem.steps} steps in a flight leave an error of {wrong:.0e}; state "
            "the problem with more steps"
        )
    return None


def orbit_grazing(problem: "ImpactingOrbits", point: Any) -> Start | None:
    """The orbit at a grazing, with the impact of speed zero taken out or put in.

    The branch goes on with the new sequence of impacts in the direction in which the
    gap that was zero opens, or the new impact gains speed.
    """
    from ._signature import with_impact, without_impact

    u = jnp.asarray(point.state)
    parameters = point.problem.parameters
    values, _ = _look(problem, u, parameters)
    values = {name: abs(float(v)) for name, v in values.items()}
    name = min(values, key=values.__getitem__)
    speeds = {key: v for key, v in values.items() if key.startswith(IMPACT)}
    slowest = min(speeds, key=speeds.__getitem__, default=name)
    # next to an impact without speed the gap has its minimum too: the impact goes
    if values[slowest] <= 1e-7 * (1.0 + float(jnp.max(jnp.abs(u)))):
        name = slowest
    number = int(name.rsplit(" ", 1)[1])
    if name.startswith(IMPACT):
        m = len(problem.constraints)
        changed, state = without_impact(problem, u, parameters, number)
        watched = f"{DIP} {(number - 1) % max(m - 1, 1)}"
    else:
        times, heights = _lowest(problem, u, parameters)
        which = int(np.argmin(np.asarray(heights)[number]))
        time = float(times[number, which])
        changed, state = with_impact(problem, u, parameters, number, time, which)
        watched = f"{IMPACT} {number + 1 if problem.constraints else 0}"
    tangent, slope = _direction(
        changed, jnp.asarray(state), parameters, point.leaf, watched
    )
    tangent = np.asarray(tangent) * (1.0 if float(slope) >= 0 else -1.0)
    if not np.all(np.isfinite(tangent)):
        return None
    return Start(changed, state, float(point.parameter), tangent)


@eqx.filter_jit
def _direction(problem, u, parameters, leaf: int, watched: str):
    """The direction of the branch, and the slope of a monitor along it."""
    p = jax.tree.leaves(parameters)[leaf]
    whole = jax.jacfwd(
        lambda z: problem.residual(z[:-1], with_leaf(parameters, leaf, z[-1]))
    )(jnp.append(u, p))
    tangent = jnp.linalg.svd(whole)[2][-1]
    _, slope = jax.jvp(
        lambda z: problem.watched(watched, z[:-1], with_leaf(parameters, leaf, z[-1])),
        (jnp.append(u, p),),
        (tangent,),
    )
    return tangent, slope
