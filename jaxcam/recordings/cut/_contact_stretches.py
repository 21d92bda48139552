"""Find long stretches near the surface without impacts, which count as contact.

The rule has two thresholds and a duration, so that noise alone does not create a
boundary: a contact stays within four times the noise for 5 ms; a flight rises above six
times the noise.
"""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
from scipy.ndimage import binary_closing

from ._motion import Motion


# First sample of a stretch, and one past its last
Span: TypeAlias = tuple[int, int]

# Gaps in units of the noise: contact is possible below the first, and flight is certain
# above the second
LOW, HIGH = 4.0, 6.0
# Minimum duration of a contact (s)
SHORTEST_CONTACT = 0.005
# A stretch near the surface that is shorter than this (s) may be a grazing contact
_GRAZE = 0.03
# Standard errors by which a slope or a curvature must differ from zero
SIGNIFICANT = 5.0
# Minimum number of samples in a flight
SHORTEST_FLIGHT = 5


def contact_stretches(
    motion: Motion, least: float = SHORTEST_CONTACT
) -> tuple[list[Span], list[Span]]:
    """Return the long stretches near the surface, including any low flights in them.

    A second list contains stretches that may be slow impacts or grazing contacts.

    **Arguments:** `least`: minimum duration of a contact (s).
    """
    near = motion.gap < LOW * motion.noise
    moving = np.zeros(len(near), bool) if motion.seen is None else motion.seen.moving
    # a single outlier among thousands of samples is not a flight
    near = binary_closing(np.pad(near, 3, mode="edge"), np.ones(3))[3:-3] & ~moving
    shortest = max(4, round(least / motion.interval))
    long = [pair for pair in stretches(near) if pair[1] - pair[0] >= shortest]
    if motion.seen is not None:
        long = [pair for pair in long if not motion.seen.turns(*pair)]
    starts = [first for first, _ in long[1:]] + [len(near)]
    doubtful = [
        (first, last)
        for (first, last), end in zip(long, starts)
        if _grazes(motion, first, last) or _bounces(motion, first, last, end)
    ]
    found = [pair for pair in long if pair not in doubtful]
    joined: list[Span] = []
    for first, last in found:
        between = slice(joined[-1][1], first) if joined else slice(0, first)
        low = np.max(motion.gap[between], initial=-np.inf) < HIGH * motion.noise
        low = low and not np.any(moving[between])
        if low and (joined or first < SHORTEST_FLIGHT):
            first = joined.pop()[0] if joined else 0
        joined.append((first, last))
    if joined and len(near) - joined[-1][1] < SHORTEST_FLIGHT:
        joined[-1] = (joined[-1][0], len(near))
    return joined, doubtful


def stretches(mask: np.ndarray) -> list[tuple[int, int]]:
    """Return start and end (one past the last) of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2])]


def overlap(one: Span, other: Span) -> bool:
    """Return whether two stretches overlap or are closer than the shortest flight."""
    margin = SHORTEST_FLIGHT
    return one[0] - margin < other[1] and other[0] < one[1] + margin


def merged(
    resting: Mapping[Span, int], doubtful: Mapping[Span, int]
) -> tuple[dict[Span, tuple[int, int]], dict[Span, tuple[int, int]]]:
    """Return the contacts and doubtful contacts, with those merged that overlap or
    touch; each has the indices of the surfaces on which it begins and ends.

    Several bodies can be in contact at the same time, each with its own surface. There
    is no flight between such contacts, so they count as one; it is doubtful only if
    all of them are.
    """
    found: list[tuple[Span, tuple[int, int], bool]] = []
    every = [(span, (k, k), False) for span, k in resting.items()]
    every += [(span, (k, k), True) for span, k in doubtful.items()]
    for span, ends, unsure in sorted(every):
        if found and span[0] <= found[-1][0][1]:
            before, (start, stop), other = found.pop()
            ends = start, ends[1] if span[1] > before[1] else stop
            span = before[0], max(before[1], span[1])
            unsure = unsure and other
        found.append((span, ends, unsure))
    return (
        {span: ends for span, ends, unsure in found if not unsure},
        {span: ends for span, ends, unsure in found if unsure},
    )


def _grazes(motion: Motion, first: int, last: int) -> bool:
    """Return whether a short stretch near the surface is the bottom of a parabola."""
    inside = motion.time[first:last]
    if len(inside) * motion.interval > _GRAZE or first == 0 or last == len(motion.time):
        return False
    scaled = np.linspace(-1.0, 1.0, len(inside))
    inverse = np.linalg.pinv(scaled[:, None] ** np.arange(3))
    curvature = inverse[2] @ motion.gap[first:last]
    error = motion.noise * np.sqrt(np.sum(inverse[2] ** 2))
    return bool(curvature > SIGNIFICANT * error)


def _bounces(motion: Motion, first: int, last: int, end: int) -> bool:
    """Return whether a short stretch near the surface is a slow impact.

    The gap after an impact curves downwards from its first sample; after a release, it
    opens as a cubic and curves upwards.
    """
    flight = motion.gap[last:end]
    if (
        (last - first) * motion.interval > _GRAZE
        or first == 0
        or np.max(flight, initial=0.0) < HIGH * motion.noise
    ):
        return False
    reach = max(8, round(0.02 / motion.interval))
    rows = slice((first + last) // 2, min(last + reach, end))
    scaled = np.linspace(-1.0, 1.0, len(motion.gap[rows]))
    inverse = np.linalg.pinv(scaled[:, None] ** np.arange(3))
    return bool(inverse[2] @ motion.gap[rows] < 0)
