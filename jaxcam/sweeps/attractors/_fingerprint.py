"""Fingerprints by which attractors are distinguished."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ._label import APERIODIC
from ._unique_rows import unique_rows


_WAVES = 8
"""Waves whose averages tell orbits of one mean apart."""


def fingerprint_size(n: int) -> int:
    """Numbers in a fingerprint of states with `n` components."""
    return n + _WAVES


def fingerprints(states, turns, origin, scale) -> np.ndarray:
    """Mean of each orbit, and of some waves over it.

    They are the same from whichever point an orbit starts, vary smoothly with it, and
    differ for different orbits, also for those that a symmetry turns into each other.

    Args:
        states: Shape `(lanes, keep, n)`; the last `turns` of them are one orbit, all of
            them where `turns` is 0.
        origin: Shape `(n,)`, in which states are of order one.
        scale: Shape `(n,)`, in which states are of order one.

    Returns:
        Shape `(lanes, fingerprint_size(n))`; NaN for lanes without an orbit.
    """
    z = (np.asarray(states) - origin) / scale
    lanes, keep, n = z.shape
    # spread evenly over a box, without a pattern and without chance
    number = np.arange(1, _WAVES + 1)[:, None]
    steps = np.exp(1 / np.arange(1.0, n + 2))
    spread = np.mod(number * steps, 1.0)
    vectors, phases = 6 * spread[:, :n] - 3, 2 * np.pi * spread[:, n]
    made = np.full((lanes, n + _WAVES), np.nan)
    for length in np.unique(turns[turns >= APERIODIC]):
        some = turns == length
        orbit = z[some][:, -(length or keep) :]
        waves = np.cos(orbit @ vectors.T + phases)
        # sorted, so that rounding does not depend on where the orbit starts
        means = [np.sort(part, axis=1).mean(axis=1) for part in (orbit, waves)]
        made[some] = np.concatenate(means, axis=1)
    return made


def clusters(points, same: float) -> np.ndarray:
    """Numbers of the groups into which points fall, shape `(k,)`.

    Points closer than `same` in every component are in one group, and so are those that
    a chain of such points joins; this does not depend on their order.
    """
    points = np.asarray(points, dtype=float)
    if not len(points):
        return np.zeros(0, dtype=int)
    # many motions end at the same point; examine each place once
    places, back = unique_rows(np.round(points / (same / 4)))
    tree = KDTree(places)
    pairs = tree.query_pairs(4.0, p=np.inf, output_type="ndarray")
    _, group = connected_components(_graph(pairs[:, 0], pairs[:, 1], len(places)),
                                    directed=False)  # fmt: skip
    return group[back]


class SharedCells:
    """Groups of motions that do not repeat: those that visit a common cell.

    Chaotic motions have no point to be known by; but two that wander over one attractor
    enter the same cells. Cells that a chain of motions joins are one group, in whatever
    order the motions come.
    """

    def __init__(self):
        self._edges: list[np.ndarray] = []

    def add(self, cells) -> np.ndarray:
        """Take motions with the cells they visit, shape `(lanes, keep)`.

        Returns:
            One cell of each, to ask for its group by at the end.
        """
        cells = np.asarray(cells)
        if not len(cells):
            return np.zeros(0, dtype=cells.dtype)
        first = np.broadcast_to(cells[:, :1], cells.shape)
        edges = np.stack([first.ravel(), cells.ravel()], axis=1)
        self._edges.append(_spanning(edges))
        return cells[:, 0]

    def groups(self, cells) -> np.ndarray:
        """Number of the group of each cell."""
        if not self._edges:
            return np.zeros(len(cells), dtype=int)
        known, group = _components(np.concatenate(self._edges))
        return group[np.searchsorted(known, cells)]


def cell_codes(states, origin, scale, fine: float) -> np.ndarray:
    """A number for the cell that each state is in, shape `(lanes, keep)`.

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
    """A smallest set of edges that joins the same cells."""
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
    # the same edge several times is one: true and true is true
    joined = np.ones(len(rows), dtype=bool)
    return coo_array((joined, (rows, columns)), shape=(count, count))
