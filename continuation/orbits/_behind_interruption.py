"""Find orbits with finitely many impacts beyond the interruption of chatter.

After the impacts near release, the deviation of such an orbit from the sticking orbit
is described by one number x > 0. The parameter at which the orbit is periodic is a
continuous function of x, with the interruption at x = 0. These orbits therefore form
one branch that begins at the interruption; towards it, the number of impacts grows by
one at each grazing bifurcation. The branch is started at a small distance from the
interruption and followed away from it.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.programs import program
from variational.chatter import next_impact, orbit_from, prepared_frame
from variational.orbits import steps_for

from .._context import Context
from .._parameter import with_leaf
from .._program import correct
from .._settings import BranchSettings
from ..problem import Start
from ._shooting import ImpactingOrbits


# maximum number of impacts of the first orbit from release to release
_MOST = 48
# minimum ratio of the slowest to the fastest rebound of this orbit; slower impacts
# would be below the tolerance
_SLOWEST = 1e-3
# the width of the bounds times powers of 2 gives the distances to try: lowest exponent,
# and maximum number of trials
_NEAREST, _TRIALS = -40, 4


def orbit_behind(point: Any, periods: int) -> Start | None:
    """Return the orbit with finitely many impacts beyond an interruption, or None.

    `point` is the interruption, with the tangent in the direction of the branch; the
    orbit repeats after `periods` forcing periods.
    """
    width = float(point.scale[-1])
    sense = 1.0 if point.tangent[-1] >= 0 else -1.0
    distances = width * 2.0 ** np.arange(_NEAREST, 1)
    values = point.parameter + sense * distances
    rows, counts, slowest = (
        np.asarray(found)
        for found in _from_release(
            point.problem.parameters, point.leaf, jnp.asarray(values), periods
        )
    )
    trials = np.flatnonzero((counts >= 2) & (counts <= _MOST) & (slowest > _SLOWEST))
    for k in trials[:_TRIALS]:
        start = _closed_up(
            periods, point, float(values[k]), rows[k, : counts[k]], sense, width
        )
        if start is not None:
            step = float(distances[k] / width) / 2
            return eqx.tree_at(lambda s: s.step, start, step, is_leaf=_is_none)
    return None


def _is_none(leaf):
    return leaf is None


@program
def _from_release(parameters: HybridSystem, leaf: int, values, periods: int):
    """Return the impacts of the motion that starts at release, for each parameter
    value.

    Returns:
        Phases of `_MOST` impacts and states after them, `(k, _MOST, 3)`; the number of
            these impacts that belong to the orbit (0 if it sticks); and the ratio of
            the slowest to the fastest rebound.
    """

    def one(value):
        system = with_leaf(parameters, leaf, value).prepared()
        frame = prepared_frame(system, jnp.zeros(()))
        orbit = orbit_from(system, frame, periods)

        def hop(carry, _):
            time, state, speed = carry
            point = next_impact(system, time, state, speed, 2 * system.period)
            row = jnp.concatenate([point.time[None] / system.period, point.state])
            return (point.time, point.state, point.speed), (row, point.speed)

        start = (frame.release, frame.state, jnp.zeros(()))
        rows, speeds = jax.lax.scan(hop, start, length=_MOST)[1]
        mine = jnp.arange(_MOST) < orbit.impacts
        fastest = jnp.max(jnp.where(mine, speeds, 0.0))
        slowest = jnp.min(jnp.where(mine, speeds, jnp.inf)) / fastest
        # the margin is NaN if contact occurs in an earlier period
        finite = jnp.isfinite(orbit.margin) & (orbit.margin > 0)
        return rows, jnp.where(finite, orbit.impacts, 0), slowest

    return jax.lax.map(one, values)


def _closed_up(
    periods: int, point: Any, value: float, rows, sense: float, width: float
) -> Start | None:
    """Return the start of a branch at the periodic orbit near the motion from release;
    None if there is no such orbit.
    """
    # a JAX array, because the forcing period is evaluated outside of a program
    moved = jnp.asarray(value, jnp.float64)
    parameters = with_leaf(point.problem.parameters, point.leaf, moved)
    count = len(rows)
    length = float(parameters.period)
    starts = rows * np.array([length, 1.0, 1.0])
    ends = np.append(starts[1:, 0], starts[0, 0] + periods * length)
    try:
        steps = steps_for(parameters, starts, ends)
    except ValueError:
        return None
    orbits = ImpactingOrbits(parameters, (0,) * count, periods, 2, steps)
    context = Context(point.leaf, width, BranchSettings())
    z = np.append(rows.ravel(), value)
    across = np.zeros_like(z)
    across[-1] = 1.0
    at = correct(orbits, context, z, across, across)
    if not at.success or orbits.refused(at.monitors, at.observed):
        return None
    if not np.all(np.isfinite(at.tangent)):
        return None
    # x grows as the parameter increases if the dominant multiplier is below one, and as
    # the parameter decreases if it is above one; all others are close to zero
    one = np.eye(at.linearisation.shape[0])
    away = sense * float(np.sign(np.linalg.det(one - at.linearisation)))
    tangent = at.tangent * (away or 1.0)
    return Start(
        orbits,
        at.z[:-1],
        float(at.z[-1]),
        tangent,
        reason=(
            f"continued with {count} impacts; between here and the interruption lie "
            "infinitely many grazing bifurcations, each with one more impact"
        ),
    )
