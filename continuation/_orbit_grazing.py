"""How an orbit goes on behind a grazing: with one impact less, or one more."""

from typing import Any, TYPE_CHECKING

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._admissible import DIP, IMPACT, look
from ._lowest_gap import lowest_times
from ._parameter import with_leaf
from ._problem import Start
from ._signature import with_impact, without_impact


if TYPE_CHECKING:
    from ._shooting import ImpactingOrbits


@eqx.filter_jit
def _lowest(problem, u, parameters):
    starts, ends = problem.flights(u, parameters)
    whole = not problem.constraints
    return jax.vmap(
        lambda a, b: lowest_times(parameters, a, b, problem.steps, whole_turn=whole)
    )(starts, ends)


def orbit_grazing(problem: "ImpactingOrbits", point: Any) -> Start | None:
    """The orbit at a grazing, with the impact of speed zero taken out or put in.

    The branch goes on with the new sequence of impacts in the direction in which the
    gap that was zero opens, or the new impact gains speed.
    """
    u = jnp.asarray(point.state)
    parameters = point.problem.parameters
    values, _ = look(problem, u, parameters)
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
