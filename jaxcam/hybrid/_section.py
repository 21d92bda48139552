"""Crossings of a Poincare section."""

import jax
import numpy as np


# places within each step at which the section function is looked at
_PLACES = 8


def crossings(trajectory, function, direction: int):
    """See `Trajectory.section`."""
    count = int(trajectory.steps.count)
    points = np.asarray(trajectory.steps.time)[:count]
    look = jax.jit(jax.vmap(function))
    share = np.linspace(0.0, 1.0, _PLACES + 1)
    grid = points[:-1, None] + share[None, :] * np.diff(points)[:, None]
    # an impact belongs to the step after it: every step ends just before its end
    tiny = 1e-12 * np.maximum(np.abs(points[1:]), 1e-3)
    ends = np.maximum(points[1:] - tiny, points[:-1])
    grid = np.minimum(grid, ends[:, None])
    values = np.asarray(look(grid.ravel(), trajectory.at(grid.ravel())))
    values = values.reshape(grid.shape)
    left, right = values[:, :-1].ravel(), values[:, 1:].ravel()
    # a zero exactly at a place belongs to the piece that ends there
    crossed = (left * right < 0) | ((right == 0) & (left != 0))
    crossed = crossed & ((right - left) * direction >= 0)
    index = np.flatnonzero(crossed)
    low, high = grid[:, :-1].ravel()[index], grid[:, 1:].ravel()[index]
    sign = left[index]
    for _ in range(52):
        middle = (low + high) / 2
        same = np.asarray(look(middle, trajectory.at(middle))) * sign > 0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return jax.device_put(high), trajectory.at(high)
