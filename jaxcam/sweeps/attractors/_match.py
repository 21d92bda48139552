"""Match attractors between two grids or two parameter values."""

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial import KDTree


def match_orbits(first, second, scale, most: float, labels=None) -> dict[int, int]:
    """Match orbits in pairs so that the sum of the distances is smallest.

    Args:
        first: Orbits, shape `(k, points, n)`, padded with NaN.
        second: Orbits, shape `(l, points, n)`, padded with NaN.
        scale: Unit of the distances, shape `(n,)`.
        most: Largest allowed distance of a pair.
        labels: Labels of both, shapes `(k, 2)` and `(l, 2)`; if given, only orbits with
            the same label are matched.

    Returns:
        For each matched index of `second`, the index of its partner in `first`.
    """
    if not len(first) or not len(second):
        return {}
    far = 1e6 + most
    cost = np.array([[orbit_distance(a, b, scale) for a in first] for b in second])
    if labels is not None:
        same = np.all(labels[1][:, None] == labels[0][None], axis=-1)
        cost = np.where(same, cost, far)
    # a pair that is too far apart has the same cost as no pair
    rows, columns = linear_sum_assignment(np.minimum(cost, most))
    return {
        int(b): int(a) for b, a in zip(rows, columns, strict=True) if cost[b, a] < most
    }


def orbit_distance(first, second, scale) -> float:
    """Return the mean distance of the points of an orbit from another orbit: the larger
    of the values for the two directions.
    """
    a, b = (np.asarray(orbit) / scale for orbit in (first, second))
    a, b = a[np.all(np.isfinite(a), axis=1)], b[np.all(np.isfinite(b), axis=1)]
    if not len(a) or not len(b):
        return np.inf
    there, back = KDTree(b).query(a)[0], KDTree(a).query(b)[0]
    return float(max(np.mean(there), np.mean(back)))
