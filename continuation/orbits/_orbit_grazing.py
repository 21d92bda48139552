"""Continue an orbit past a grazing bifurcation, with one impact fewer or more."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid.programs import program
from variational.orbits import lowest_times

from .._context import Context
from .._padding import as_compiled
from .._parameter import as_arguments
from .._point import set_parameters
from .._program import evaluate
from .._settings import BranchSettings
from ..problem import Start
from ._signature import with_impact, without_impact
from ._watched import Watched, watched_of


# displacement for the difference that gives the sign of a slope, for unknowns of size
# one
_NUDGE = 1e-6


@program
def _lowest(problem, u, parameters):
    starts, ends = problem.equations.flights(u, parameters)
    steps, whole = problem.equations.steps, not problem.equations.rows
    times, heights = jax.vmap(
        lambda a, b: lowest_times(parameters, a, b, steps, whole_turn=whole)
    )(starts, ends)
    return starts, times, heights


def orbit_grazing(problem: Any, point: Any) -> Start | None:
    """Return the start of a branch at grazing, with the impact of zero speed removed or
    inserted.

    `problem` is an `ImpactingOrbits`, and so is the problem of the start.

    The branch continues with the new impact sequence in the direction in which the gap
    that was zero opens, or the new impact gains speed.
    """
    u = jnp.asarray(point.state)
    parameters = point.problem.parameters
    z = np.append(point.state, point.parameter)
    context = Context(point.leaf, float(point.scale[-1]), BranchSettings())
    at = evaluate(problem, context, z, np.ones_like(z))
    m = len(problem.constraints)
    values = {w: abs(float(at.monitors[name])) for name, w in watched_of(m).items()}
    zero = min(values, key=values.__getitem__)
    speeds = [w for w in values if w.what == "speed"]
    slowest = min(speeds, key=values.__getitem__, default=zero)
    # at an impact of zero speed, the minimum of the gap is also zero: remove the impact
    if values[slowest] <= 1e-7 * (1.0 + float(jnp.max(jnp.abs(u)))):
        zero = slowest
    number = zero.number
    if zero.what == "speed":
        equations, state = without_impact(problem.equations, u, parameters, number)
        watched = Watched("gap", (number - 1) % max(m - 1, 1))
    else:
        starts, times, heights = _lowest(*as_compiled(problem, u), parameters)
        which = int(np.argmin(np.asarray(heights)[number]))
        time = float(times[number, which])
        start = np.asarray(starts)[number]
        equations, state = with_impact(
            problem.equations, u, parameters, number, start, time, which
        )
        watched = Watched("speed", number + 1 if m else 0)
    changed = problem.of(parameters, equations)
    changed = set_parameters(changed, as_arguments(changed.parameters, point.leaf))
    tangent = _direction(changed, context, np.asarray(state), point, watched.name)
    if tangent is None:
        return None
    return Start(changed, state, float(point.parameter), tangent)


def _direction(
    problem, context: Context, u, point: Any, watched: str
) -> np.ndarray | None:
    """Return the direction of the branch in which a monitor grows.

    The slope is a difference quotient, computed with the compiled program of the
    continued branch; this is sufficient, because only the sign of the slope matters.
    """
    z = np.append(u, point.parameter)
    one = np.ones_like(z)
    at = evaluate(problem, context, z, one)
    if not np.all(np.isfinite(at.jacobian)):
        return None
    tangent = np.linalg.svd(at.jacobian)[2][-1]
    ahead, behind = (
        evaluate(problem, context, z + sign * _NUDGE * tangent, one).monitors[watched]
        for sign in (1, -1)
    )
    slope = float(ahead - behind)
    if not np.isfinite(slope):
        return None
    return tangent if slope >= 0 else -tangent
