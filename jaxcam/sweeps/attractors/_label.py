"""Determine labels P(m, n): motions that repeat after n periods, with m impacts."""

from typing import NamedTuple

import numpy as np

from ...hybrid.codes import BEHIND as STARTS_BEHIND, NOT_FINITE
from ..sections import BEHIND, Samples
from ._unique_rows import unique_rows


APERIODIC, ESCAPED, FAILED, OUTSIDE = 0, -1, -2, -3
"""Codes used instead of a number of periods."""
STICKING, CONTACT, UNCOUNTED = -1, -2, -3
"""Codes used instead of a number of impacts: infinitely many, permanent contact, not
counted.
"""

# points count as still approaching each other if the largest of their last distances is
# less than this fraction of the largest of their first distances
_STEADY = 0.9
# points of one period count as different only if they are further apart than this many
# times the tolerance: an inaccurate integration, as across an undeclared corner, makes
# the points of a shorter orbit alternate by about the tolerance
_DISTINCT = 10.0


class Labels(NamedTuple):
    """The attractor type of each motion, as small integers.

    `turns` is the period in forcing periods (or in points, on a section that is not
    sampled once per period), or one of `APERIODIC`, `ESCAPED`, `FAILED` and `OUTSIDE`;
    `impacts` is the number of impacts in one period of the orbit, or one of `STICKING`,
    `CONTACT` and `UNCOUNTED`.
    """

    impacts: np.ndarray
    """Number of impacts per orbit, or one of `STICKING`, `CONTACT` and `UNCOUNTED`."""
    turns: np.ndarray
    """Period in forcing periods (or points, on other sections), or one of `APERIODIC`,
    `ESCAPED`, `FAILED` and `OUTSIDE`.
    """


def periods(states, period_tolerance: float = 1e-6, sizes=None) -> np.ndarray:
    """Return the smallest period of each motion, in points; 0 if there is none.

    A motion that spirals in towards an orbit temporarily appears to have a multiple of
    the period of the orbit. Such a motion counts as non-periodic until its points stop
    approaching the orbit. Points that differ by less than ten times the tolerance do
    not make a period longer, because errors of the integration may have caused the
    difference.

    Args:
        states: Samples, shape `(motions, keep, n)`; periods up to `keep / 2` are
            detected, so each is observed twice.
        period_tolerance: Allowed difference of two states, relative to `sizes`.
        sizes: Scale of each component, shape `(motions, n)`; default: its largest
            value.

    Returns:
        Periods, shape `(motions,)`.

    Examples:
        >>> from jaxcam.sweeps.attractors import periods
        >>> alternating, irregular = [1, 2] * 4, [3, 1, 4, 1, 5, 9, 2, 6]
        >>> periods(np.array([alternating, irregular])[..., None]).tolist()
        [2, 0]
    """
    states = np.asarray(states, dtype=float)
    lanes, keep, _ = states.shape
    found = np.zeros(lanes, dtype=int)
    if sizes is None:
        sizes = np.abs(states).max(axis=1)
    room = np.broadcast_to(period_tolerance * sizes[:, None], states.shape)
    left = np.arange(lanes)
    for n in range(1, keep // 2 + 1):
        if not len(left):
            break
        # for most motions, a single pair of points suffices to exclude this period
        last = np.abs(states[left, -1] - states[left, -1 - n]) <= room[left, -1]
        likely = left[np.all(last, axis=1)]
        gone = np.abs(states[likely, n:] - states[likely, :-n])
        same = np.all(gone <= room[likely, n:], axis=(1, 2))
        found[likely[same]] = n
        left = left[found[left] == 0]
    for n in np.unique(found[found > 1]):
        (some,) = np.nonzero(found == n)
        nearing = _still_nearing(states[some], int(n))
        found[some[nearing]] = 0
        some = some[~nearing]
        found[some] = _distinct_period(states[some], int(n), _DISTINCT * room[some])
    return found


def _distinct_period(states, n: int, room) -> np.ndarray:
    """Return the smallest divisor of a period after which all points are as close as
    `room`, or the period itself.
    """
    found = np.full(len(states), n)
    for part in range(n - 1, 0, -1):
        if n % part == 0:
            apart = np.abs(states[:, part:] - states[:, :-part])
            found[np.all(apart <= room[:, part:], axis=(1, 2))] = part
    return found


def _still_nearing(states, n: int) -> np.ndarray:
    """Return whether points that are a fraction of the period apart still approach each
    other.
    """
    nearing = np.zeros(len(states), dtype=bool)
    for part in range(1, n):
        if n % part:
            continue
        apart = np.abs(states[:, part:] - states[:, :-part]).max(axis=2)
        first, last = apart[:, :n].max(axis=1), apart[:, -n:].max(axis=1)
        nearing |= last < _STEADY * first
    return nearing


def label(
    samples: Samples, period_tolerance: float = 1e-6, impacting: bool = True, sizes=None
) -> Labels:
    """Return the label of each motion.

    Args:
        samples: Samples of a section.
        period_tolerance: As for [`jaxcam.sweeps.attractors.periods`][].
        impacting: Whether impacts are counted; for a map, they are not.
        sizes: As for [`jaxcam.sweeps.attractors.periods`][].

    Returns:
        The labels.

    Examples:
        >>> from jaxcam import sweeps
        >>> from jaxcam.models import ImpactOscillator
        >>> from jaxcam.sweeps.attractors import label
        >>> section = sweeps.Stroboscopic(ImpactOscillator(omega=2.8, wall=-0.5))
        >>> samples = section.sample(np.array([[-0.8, 1.0]]), turns=200, keep=8)
        >>> found = label(samples)
        >>> found.impacts.tolist(), found.turns.tolist()  # P(1,1)
        ([1], [1])
    """
    turns = periods(samples.states, period_tolerance, sizes)
    index = np.maximum(turns, 1)[:, None] - 1

    def in_the_orbit(counts):
        total = np.cumsum(counts[:, ::-1], axis=1)
        return np.take_along_axis(total, index, axis=1)[:, 0]

    impacts = in_the_orbit(samples.hits)
    impacts = np.where(in_the_orbit(samples.rests) > 0, STICKING, impacts)
    impacts = np.where(samples.contact, CONTACT, impacts)
    if not impacting:
        impacts = np.full_like(impacts, UNCOUNTED)
    impacts = np.where(turns > 0, impacts, UNCOUNTED)
    for codes, kind in (((NOT_FINITE,), ESCAPED), ((BEHIND, STARTS_BEHIND), OUTSIDE)):
        turns = np.where(np.isin(samples.code, codes), kind, turns)
    other = (samples.code != 0) & (turns == APERIODIC)
    turns = np.where(other, FAILED, turns)
    impacts = np.where(turns > 0, impacts, UNCOUNTED)
    return Labels(impacts.astype(np.int32), turns.astype(np.int32))


def label_name(impacts: int, turns: int) -> str:
    """Return the label as text: P(1,1), P(inf,1), contact, period 3, aperiodic, ..."""
    words = {
        APERIODIC: "aperiodic",
        ESCAPED: "escaped",
        FAILED: "failed",
        OUTSIDE: "outside",
    }
    if int(turns) in words:
        return words[int(turns)]
    if impacts == CONTACT:
        return "contact"
    if impacts == UNCOUNTED:
        return f"period {turns}"
    return f"P({'inf' if impacts == STICKING else impacts},{turns})"


def label_names(labels: Labels) -> np.ndarray:
    """Return all labels as text, in the shape of the labels."""
    pairs = np.stack([labels.impacts, labels.turns], axis=-1)
    unique, back = unique_rows(pairs.reshape(-1, 2))
    words = np.array([label_name(int(m), int(n)) for m, n in unique], dtype=object)
    return words[back].reshape(labels.turns.shape)
