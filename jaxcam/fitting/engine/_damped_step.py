"""Take one damped scoring step within the bounds of the parameters."""

import jax.numpy as jnp
import numpy as np

from ._columns import gathered, off_nominal, prior_information
from ._eliminate import eliminate_states, LEAST, state_steps
from ._linearise import Blocks


def damped_step(problem, columns, blocks, point, damping, prior, states=0.0):
    """Return one damped step within the bounds, and the predicted decrease of the
    cost.

    **Arguments:** `damping` of the parameters, relative to their scales, and of the
    `states`, as a fraction of their own information.
    """
    found = eliminate_states(blocks, jnp.asarray(LEAST + states))
    size = len(columns.scale)
    information, score = gathered(columns, found)
    strength = prior_information(problem, columns, prior)
    information = information + np.diag(strength)
    if size:
        score = score - strength * off_nominal(problem, columns, point)
    change = _bounded(problem, columns, point, information, score, damping)
    filled = np.append(change, 0.0)[columns.place]
    steps = state_steps(found, jnp.asarray(filled))
    values = np.array(point.values)
    for r, (place, local) in enumerate(zip(columns.place, columns.local)):
        used = place >= 0
        values[r, local[used]] += change[place[used]] * columns.scale[place[used]]
    # the decrease that the quadratic model of the cost predicts for the full step
    gain = float(change @ score) + _state_gain(blocks, found)
    states = point.states + steps
    moved = point._replace(values=jnp.asarray(values), states=states)
    return moved, gain


def _state_gain(blocks: Blocks, found) -> float:
    """Return the predicted decrease of the cost due to the states at unchanged
    parameters: the product of the scores and the steps of the states.
    """
    none = jnp.zeros((found.score.shape[0], found.score.shape[1]))
    return float(jnp.sum(blocks.s * state_steps(found, none)))


def _bounded(problem, columns, point, information, score, damping):
    """Return the damped step of the free values; a value that would pass a bound is
    held at that bound.
    """
    size = len(columns.scale)
    change = np.zeros(size)
    if not size:
        return change
    values = np.asarray(point.values)
    now = values[np.maximum(columns.record, 0), columns.parameter]
    low = np.array([problem.parameters[p].lower for p in columns.parameter])
    high = np.array([problem.parameters[p].upper for p in columns.parameter])
    low, high = (low - now) / columns.scale, (high - now) / columns.scale
    held = np.zeros(size, dtype=bool)
    damped = information + damping * np.eye(size)
    if not (np.all(np.isfinite(damped)) and np.all(np.isfinite(score))):
        return np.full(size, np.nan)
    for _ in range(size):
        open_ = ~held
        if not np.any(open_):
            break
        right = score[open_] - damped[np.ix_(open_, held)] @ change[held]
        try:
            change[open_] = np.linalg.solve(damped[np.ix_(open_, open_)], right)
        except np.linalg.LinAlgError:
            # the matrix is singular to within rounding: more damping is needed
            return np.full(size, np.nan)
        beyond = open_ & ((change < low) | (change > high))
        if not np.any(beyond):
            break
        change = np.clip(change, low, high)
        held |= beyond
    return np.clip(change, low, high)
