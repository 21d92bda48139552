"""Represent an orbit starting from another impact, or traversed twice."""

import dataclasses
from typing import Any

import numpy as np
from jaxtyping import Float

from ..problem import Start


def run_twice(problem: Any, u, deviation) -> tuple[np.ndarray, np.ndarray]:
    """Return the state and tangent of the orbit traversed twice, with opposite
    deviations in the two traversals.
    """
    if not problem.constraints:
        # the only unknown is the state at time zero
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
    # time is measured from the first impact, which must not move
    change[:, 0] -= change[0, 0]
    rows[:, 0] /= 2
    change[:, 0] /= 2
    rows[0, 0] = 2 * period
    return rows.ravel(), change.ravel()


def shooting_twice(problem: Any, point: Any, direction: np.ndarray) -> Start:
    """Return the start of the branch of orbits that repeat after two traversals.

    **Arguments:** `problem`: a `SingleShooting`; `direction`: the direction of the
    multiplier -1.
    """
    state = np.asarray(point.state)
    if problem.periods:
        twice = dataclasses.replace(problem, periods=2 * problem.periods)
        return Start(twice, state, point.parameter, np.append(direction, 0.0))
    sizes = np.asarray(problem.scale(state, point.problem.parameters))[:-1]
    normal = np.asarray(problem.normal) / sizes
    across = np.linalg.svd(normal[None])[2][1:].T
    twice = dataclasses.replace(problem, turns=2 * problem.turns)
    state = np.append(state[:-1], 2 * state[-1])
    tangent = np.concatenate([across @ direction, [0.0, 0.0]])
    return Start(twice, state, point.parameter, tangent)


def rotations(
    problem: Any, u: Float[np.ndarray, " u"], rate: bool = False
) -> Float[np.ndarray, "m u"]:
    """Return the unknowns of an orbit for a start at each of its m impacts.

    **Arguments:** `rate`: whether `u` is a derivative of the unknowns along a branch.
    """
    m = len(problem.constraints)
    turn = 0.0 if rate else float(max(problem.periods, 1))
    found = []
    for k in range(m):
        rows = np.array(u, float).reshape(m, 1 + problem.dimension)
        length = rows[0, 0]
        if not problem.periods:
            # the period takes the place of the first phase
            rows[0, 0] = 0.0
        rows = np.roll(rows, -k, axis=0)
        rows[m - k :, 0] += turn
        if not problem.periods:
            rows[:, 0] -= rows[0, 0]
            rows[0, 0] = length
        found.append(rows.ravel())
    return np.stack(found)


def away_from_half(problem: Any, u, parameters) -> float | None:
    """Return the distance between the halves of an orbit in step lengths; None if their
    impacts differ.
    """
    m, periods = len(problem.constraints), problem.periods
    hits = problem.constraints
    if m == 0 or m % 2 or periods % 2 or hits[: m // 2] != hits[m // 2 :]:
        return None
    other = rotations(problem, np.asarray(u))[m // 2]
    if periods:
        other.reshape(m, -1)[:, 0] -= periods // 2
    scale = np.asarray(problem.scale(np.asarray(u), parameters))
    return float(np.linalg.norm((other - u) / scale) / np.sqrt(scale.size))
