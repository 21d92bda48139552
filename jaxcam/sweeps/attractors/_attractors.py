"""Find the attractors of all motions of a sweep, in a fixed order."""

from typing import NamedTuple

import numpy as np

from ._fingerprint import clusters, SharedCells
from ._label import APERIODIC, ESCAPED, FAILED, label_name, OUTSIDE
from ._unique_rows import unique_rows


NONE = {ESCAPED: -1, FAILED: -2, OUTSIDE: -3}
"""Codes used instead of the number of an attractor."""


class Attractors(NamedTuple):
    """The attractors, periodic ones first, in order of period, impacts and position."""

    impacts: np.ndarray
    turns: np.ndarray
    fingerprint: np.ndarray
    """Fingerprints, shape (attractors, means); see `fingerprints`."""
    lane: np.ndarray
    """Representative motion of each attractor, shape (attractors,)."""

    def __len__(self) -> int:
        return len(self.turns)


def find_attractors(
    impacts, turns, fingerprint, cells, starts, same: float
) -> tuple[np.ndarray, Attractors]:
    """Find the attractors, and the attractor of each motion.

    Args:
        impacts: Number of impacts in each label, shape `(motions,)`.
        turns: Number of periods in each label, shape `(motions,)`.
        fingerprint: Shape `(motions, means)`.
        cells: An iterable of pairs: indices of non-periodic motions, and the cells
            `(motions, keep)` that they visit.
        starts: Initial states, `(motions, n)`. Of several motions on an attractor, the
            one whose initial state is first in lexicographic order represents it.
        same: Two orbits are equal if their fingerprints differ by less than this.

    Returns:
        The attractor numbers `(motions,)`, with -1 for motions that escaped, -2 for
            those that failed and -3 for those that could not start; and the attractors.
    """
    lanes = len(turns)
    group = np.full(lanes, -1)
    key = np.stack([impacts, turns], axis=1)
    count = 0
    for m, n in unique_rows(key[turns > 0])[0]:
        (some,) = np.nonzero((impacts == m) & (turns == n))
        group[some] = count + clusters(fingerprint[some], same)
        count = group[some].max() + 1
    shared, known, places = SharedCells(), [], []
    for some, visited in cells:
        if len(some):
            known.append(some)
            places.append(shared.add(visited))
    if known:
        some, place = np.concatenate(known), np.concatenate(places)
        group[some] = count + shared.groups(place)
    return _ordered(group, impacts, turns, fingerprint, starts)


def _ordered(group, impacts, turns, fingerprint, starts):
    """Return numbers and attractors that do not depend on the order of the motions."""
    found = group >= 0
    used = np.unique(group[found])
    # the motion whose initial state is first in lexicographic order represents its
    # group, whatever the order of the motions
    order = np.lexsort((*starts.T[::-1], group))
    order = order[found[order]]
    first = order[np.searchsorted(group[order], used)]
    irregular = turns[first] == APERIODIC
    rounded = np.round(fingerprint[first], 6)
    keys = (*rounded.T[::-1], impacts[first], turns[first], irregular)
    rank = np.lexsort(keys)
    first = first[rank]
    number = np.full(len(group), -1)
    place = np.empty(len(used), dtype=int)
    place[rank] = np.arange(len(used))
    number[found] = place[np.searchsorted(used, group[found])]
    for kind, value in NONE.items():
        number[turns == kind] = value
    return number, Attractors(impacts[first], turns[first], fingerprint[first], first)


def attractor_names(impacts, turns) -> list[str]:
    """Return names such as P(1,1), P(6,6) a and P(6,6) b, in which letters distinguish
    equal labels.
    """
    plain = [label_name(int(m), int(n)) for m, n in zip(impacts, turns, strict=True)]
    made = []
    for i, word in enumerate(plain):
        if plain.count(word) == 1:
            made.append(word)
        else:
            made.append(f"{word} {_letters(plain[:i].count(word))}")
    return made


def _letters(number: int) -> str:
    """Return a, b, ..., z, aa, ab, ..."""
    letters = ""
    number += 1
    while number:
        number, rest = divmod(number - 1, 26)
        letters = chr(ord("a") + rest) + letters
    return letters
