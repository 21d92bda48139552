"""Crossings of a Poincaré section."""

import jax
import numpy as np

from ._sample import pad


# number of parts of each step at whose ends the section function is evaluated
_PLACES = 8


def crossings(trajectory, function, direction: int):
    """Return the times and states of the crossings; see `Trajectory.section`."""

    def look(times):
        # padded, so that few lengths are compiled
        longer = pad(times, points[0])
        values = jax.vmap(function)(longer, trajectory.at(longer))
        return np.asarray(values)[: len(times)]

    points = np.asarray(trajectory.steps.time)[: int(trajectory.steps.count)]
    share = np.linspace(0.0, 1.0, _PLACES + 1)
    grid = points[:-1, None] + share[None, :] * np.diff(points)[:, None]
    # an impact belongs to the step after it, so every step is searched up to just
    # before its end
    tiny = 1e-12 * np.maximum(np.abs(points[1:]), np.diff(points))
    ends = np.maximum(points[1:] - tiny, points[:-1])
    grid = np.minimum(grid, ends[:, None])
    values = look(grid.ravel()).reshape(grid.shape)
    left, right = values[:, :-1].ravel(), values[:, 1:].ravel()
    # a zero exactly at a point belongs to the piece that ends there
    crossed = (np.sign(left) * np.sign(right) < 0) | ((right == 0) & (left != 0))
    crossed = crossed & (np.sign(right - left) * direction >= 0)
    index = np.flatnonzero(crossed)
    low, high = grid[:, :-1].ravel()[index], grid[:, 1:].ravel()[index]
    sign = np.sign(left[index])
    for _ in range(52):
        middle = (low + high) / 2
        same = np.sign(look(middle)) * sign > 0
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    return jax.device_put(high), trajectory.at(high)
