"""Compute fingerprints that distinguish attractors."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ._label import APERIODIC
from ._unique_rows import unique_rows


_WAVES = 8
"""Number of waves whose averages distinguish orbits with the same mean."""


def fingerprint_size(n: int) -> int:
    """Return the length of a fingerprint of states with `n` components."""
    return n + _WAVES


def fingerprints(states, turns, origin, scale) -> np.ndarray:
    """Compute, for each orbit, the means of the states and of some waves.

    These fingerprints do not depend on the starting point on the orbit, vary smoothly
    with the orbit, and differ for different orbits, including symmetric images of each
    other.

    Args:
        states: States, shape `(motions, keep, n)`; the last `turns` states are one
            orbit, or all of them if `turns` is 0.
        origin: Origin, shape `(n,)`; `(states - origin) / scale` is of order one.
        scale: Scale of the states, shape `(n,)`.

    Returns:
        Fingerprints, shape `(motions, fingerprint_size(n))`; NaN for motions without an
            orbit.
    """
    z = (np.asarray(states) - origin) / scale
    lanes, keep, n = z.shape
    # wave vectors and phases from a quasi-random sequence, the same in every run
    number = np.arange(1, _WAVES + 1)[:, None]
    steps = np.exp(1 / np.arange(1.0, n + 2))
    spread = np.mod(number * steps, 1.0)
    vectors, phases = 6 * spread[:, :n] - 3, 2 * np.pi * spread[:, n]
    made = np.full((lanes, n + _WAVES), np.nan)
    for length in np.unique(turns[turns >= APERIODIC]):
        some = turns == length
        orbit = z[some][:, -(length or keep) :]
        waves = np.cos(orbit @ vectors.T + phases)
        # add in sorted order, so that rounding does not depend on the starting point
        means = [np.sort(part, axis=1).mean(axis=1) for part in (orbit, waves)]
        made[some] = np.concatenate(means, axis=1)
    return made


def clusters(points, same: float) -> np.ndarray:
    """Return the group number of each point, shape `(k,)`.

    Points closer than `same` in every component are in the same group, as are points
    connected by a chain of such points, regardless of their order.
    """
    points = np.asarray(points, dtype=float)
    if not len(points):
        return np.zeros(0, dtype=int)
    # many motions end at the same point, so each position is examined once
    places, back = unique_rows(np.round(points / (same / 4)))
    tree = KDTree(places)
    pairs = tree.query_pairs(4.0, p=np.inf, output_type="ndarray")
    _, group = connected_components(_graph(pairs[:, 0], pairs[:, 1], len(places)),
                                    directed=False)  # fmt: skip
    return group[back]


class SharedCells:
    """Groups of non-periodic motions that visit common cells.

    Chaotic motions have no characteristic point, but two motions on the same attractor
    enter the same cells. Cells connected by a chain of motions form one group,
    regardless of the order of the motions.
    """

    def __init__(self):
        self._edges: list[np.ndarray] = []

    def add(self, cells) -> np.ndarray:
        """Add motions with the cells they visit, shape `(motions, keep)`.

        Returns:
            One cell of each motion, used to look up its group at the end.
        """
        cells = np.asarray(cells)
        if not len(cells):
            return np.zeros(0, dtype=cells.dtype)
        first = np.broadcast_to(cells[:, :1], cells.shape)
        edges = np.stack([first.ravel(), cells.ravel()], axis=1)
        self._edges.append(_spanning(edges))
        return cells[:, 0]

    def groups(self, cells) -> np.ndarray:
        """Return the number of the group of each cell."""
        if not self._edges:
            return np.zeros(len(cells), dtype=int)
        known, group = _components(np.concatenate(self._edges))
        return group[np.searchsorted(known, cells)]


def cell_codes(states, origin, scale, fine: float) -> np.ndarray:
    """Return the number of the cell of each state, shape `(motions, keep)`.

    **Arguments:** `fine`: extent of a cell in units of `scale`.
    """
    z = (np.asarray(states) - origin) / (scale * fine)
    n = z.shape[-1]
    bits = 62 // n
    half = 1 << (bits - 1)
    place = np.clip(np.floor(np.nan_to_num(z)), -half, half - 1).astype(np.int64) + half
    code = np.zeros(place.shape[:-1], dtype=np.int64)
    for i in range(n):
        code = (code << bits) | place[..., i]
    return code


def _spanning(edges) -> np.ndarray:
    """Return a minimal set of edges that connects the same cells."""
    known, group = _components(edges)
    order = np.argsort(group, kind="stable")
    starts = np.searchsorted(group[order], group)
    return np.stack([known[order][starts], known], axis=1)


def _components(edges):
    known, back = np.unique(edges, return_inverse=True)
    back = back.reshape(edges.shape)
    graph = _graph(back[:, 0], back[:, 1], len(known))
    return known, connected_components(graph, directed=False)[1]


def _graph(rows, columns, count: int):
    # with booleans, repeated edges are merged
    joined = np.ones(len(rows), dtype=bool)
    return coo_array((joined, (rows, columns)), shape=(count, count))
