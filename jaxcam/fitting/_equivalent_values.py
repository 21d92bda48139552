"""Find the values nearest to the nominal ones with which a model predicts the same."""

import math

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from ._descend import Objective
from .engine import nominal_of, Point


# Unit of the parameters that may be angles
_ANGLE = "rad"
# Relative increase of a cost that is due to rounding
_ROUNDING = 1e-6


def nearest_equivalent(objective: Objective, point: Point, cost: float) -> Point | None:
    """Return a point with the same predictions, nearer to the nominal values, or `None`
    if none is known.

    The phase of an oscillation is the same after a full turn, and its amplitude may
    change its sign if the phase is shifted by half a turn. Both are tried with the
    parameters in radians; a change counts only if all values are within their bounds
    and the cost does not increase.

    Args:
        objective: The cost.
        point: The end of a fit.
        cost: Its cost, finite.
    """
    problem, found = objective.problem, None
    low = np.array([one.lower for one in problem.parameters])
    high = np.array([one.upper for one in problem.parameters])
    values = np.array(point.values)
    free = list(dict.fromkeys(objective.columns.parameter.tolist()))
    angles = [p for p in free if problem.parameters[p].unit == _ANGLE]

    def turned(values, angle: int) -> Float[np.ndarray, "r q"]:
        """Return the values with an angle within half a turn of its nominal value, in
        each recording in which the bounds permit it.
        """
        trial, turn, own = values.copy(), 2 * math.pi, values[:, angle]
        near = own - turn * np.round((own - nominal_of(problem, angle)) / turn)
        within = (low[angle] <= near) & (near <= high[angle])
        trial[:, angle] = np.where(within, near, own)
        return trial

    def accepted(trial) -> bool:
        nonlocal found, values, cost
        if np.any((trial < low) | (trial > high)):
            return False
        at = point._replace(values=jnp.asarray(trial))
        after = objective.at(at).cost
        if not after <= cost + _ROUNDING * (1 + abs(cost)):
            return False
        found, values, cost = at, trial, after
        return True

    for angle in angles:
        trial = turned(values, angle)
        if not np.array_equal(trial, values):
            accepted(trial)
    for p in free:
        wrong = values[:, p] * nominal_of(problem, p) < 0
        for angle in angles if np.any(wrong) else ():
            if p == angle or not (
                problem.parameters[angle].per_record or np.all(wrong)
            ):
                continue
            trial = values.copy()
            trial[wrong, p] *= -1
            trial[wrong, angle] += math.pi
            if accepted(turned(trial, angle)):
                break
    return found
