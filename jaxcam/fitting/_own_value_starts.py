"""Starting values for parameters that have a value of their own in each recording."""

import math

import jax
import jax.numpy as jnp
import numpy as np

from ._descend import Objective
from .engine import cost_by_recording, nominal_of, own_states, Point, Weights


# Number of values, spread evenly over the tolerance, at which each recording is tried
_VALUES = 8


def own_value_starts(objective: Objective, point: Point) -> Point | None:
    """Return a point at which each recording has the best of several values.

    A fit from a drive phase that is wrong by more than a quarter of a turn may end in a
    local minimum. Each such parameter is therefore tried at several values within its
    tolerance. The recordings are independent of each other there, so that a few
    evaluations serve any number of them.

    **Returns:** `None` if no free parameter with a finite tolerance has a value of its
    own in each recording.
    """
    problem = objective.problem
    own = [
        p
        for p in dict.fromkeys(objective.columns.parameter.tolist())
        if problem.parameters[p].per_record
        and math.isfinite(problem.parameters[p].tolerance)
    ]
    if not own:
        return None
    best = point
    for p in own:
        one = problem.parameters[p]
        middle = nominal_of(problem, p)
        shares = (2 * np.arange(_VALUES) + 1) / _VALUES - 1
        found, least = best, _record_costs(objective, best)
        for value in np.clip(middle + shares * one.tolerance, one.lower, one.upper):
            values = np.array(best.values)
            values[:, p] = value
            at = point._replace(values=jnp.asarray(values))
            at = own_states(problem.layout, problem.pieces, objective.extras, at)
            costs = _record_costs(objective, at)
            # a cost that is not finite is never better
            wins = jnp.asarray(costs < least)
            found = jax.tree.map(
                lambda new, old: jnp.where(
                    jnp.reshape(wins, (-1, *[1] * (new.ndim - 1))), new, old
                ),
                at,
                found,
            )
            least = np.where(wins, costs, least)
        best = found
    return best


def _record_costs(objective: Objective, point: Point) -> np.ndarray:
    """Return the cost of each recording, infinite if it is not finite."""
    extras = objective.extras
    weights = Weights(np.asarray(extras.weight), np.asarray(extras.rest_weight))
    with np.errstate(over="ignore", invalid="ignore"):
        total = cost_by_recording(objective.at(point).costs, weights)
    return np.where(np.isfinite(total), total, np.inf)
