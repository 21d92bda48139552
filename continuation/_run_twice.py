"""An orbit run through twice, from where a flip doubles it."""

from typing import Any

import numpy as np


def run_twice(problem: Any, u, deviation) -> tuple[np.ndarray, np.ndarray]:
    """State and tangent of the orbit run through twice, deviating with each sign."""
    if not problem.constraints:
        # the state at time zero only
        return u, deviation
    shape = (len(problem.constraints), 1 + problem.dimension)
    first, moved = u.reshape(shape).copy(), deviation.reshape(shape).copy()
    change = np.concatenate([moved, -moved])
    if problem.periods:
        second = first + np.eye(1, shape[1]) * problem.periods
        return np.concatenate([first, second]).ravel(), change.ravel()
    period, first[0, 0] = first[0, 0], 0.0
    second = first + np.eye(1, shape[1])
    rows = np.concatenate([first, second])
    # time counts from the first impact, which must not move
    change[:, 0] -= change[0, 0]
    rows[:, 0] /= 2
    change[:, 0] /= 2
    rows[0, 0] = 2 * period
    return rows.ravel(), change.ravel()
