"""Match the events of two runs."""

from typing import NamedTuple

import numpy as np


class Events(NamedTuple):
    """Impacts and contacts of a run, in the time units of the problem.

    The impacts of a sequence that ends in contact are listed as far as the run resolves
    them; the time intervals (first, last) of the unresolved ones are in `sequences`.
    """

    # (k, 2): time, constraint
    impacts: np.ndarray
    # (k, 3): start, end (infinite if still in contact), constraint
    contacts: np.ndarray
    sequences: list[tuple[float, float]]


class Mismatch(NamedTuple):
    """The first event that the two runs do not share."""

    time: float
    what: str


def outside(impacts: np.ndarray, sequences, room: float) -> np.ndarray:
    """The impacts outside all sequences, where the first impact of a sequence counts as
    outside.
    """
    keep = np.ones(len(impacts), bool)
    for first, last in sequences:
        keep &= ~((impacts[:, 0] > first + room) & (impacts[:, 0] <= last + room))
    return impacts[keep]


def listed(events: Events, other: Events, room: float) -> np.ndarray:
    """The impacts of a run that the other run must also have."""
    both = [*events.sequences, *other.sequences]
    return outside(events.impacts, both, room)


def pairs(one: np.ndarray, other: np.ndarray, end: float, room):
    """Pair the rows of two lists of events in order, up to `end`.

    **Arguments:** events, with the time first and the constraint last; `room(t)`, the
    permitted difference of times at t.

    **Returns:** the pairs, and the first `Mismatch` or `None`.
    """
    one, other = list(one), list(other)
    found = []
    while one or other:
        nearest = min(row[0] for row in (*one[:1], *other[:1]))
        if nearest > end - room(min(nearest, end)):
            break
        if not one or not other:
            row = (one or other)[0]
            return found, Mismatch(nearest, f"one more event of gap {int(row[-1])}")
        row = one.pop(0)
        reach = room(row[0])
        # simultaneous events of different gaps may come in any order
        near = (
            i
            for i, mate in enumerate(other[:6])
            if abs(mate[0] - row[0]) <= reach and mate[-1] == row[-1]
        )
        match = next(near, None)
        if match is None:
            at = min(row[0], other[0][0])
            said = f"{row[0]:.9g} of gap {int(row[-1])}"
            said += f" against {other[0][0]:.9g} of gap {int(other[0][-1])}"
            return found, Mismatch(at, said)
        found.append((row, other.pop(match)))
    return found, None
