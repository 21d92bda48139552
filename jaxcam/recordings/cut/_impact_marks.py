"""Find flights that end in impacts.

A velocity jump separates two flights, however short the contact is.
"""

from collections.abc import Sequence

import numpy as np

from ._contact_stretches import (
    LOW,
    overlap,
    SHORTEST_FLIGHT,
    SIGNIFICANT,
    Span,
    stretches,
)
from ._motion import Motion


def impact_marks(
    motion: Motion, resting: list[Span], doubted: Sequence[Span] = ()
) -> list[int]:
    """Return the index of the first sample after each impact between two flights.

    **Arguments:** `resting` are the stretches of contact, `doubted` those in which an
    impact is expected.
    """
    marks = motion.jumps()
    near = stretches(motion.gap < LOW * motion.noise)
    for first, last in (*near, *doubted):
        taken = [*resting, *((mark, mark + 1) for mark in marks)]
        if any(overlap((first, last), other) for other in taken):
            continue
        # use only samples that belong to the flights on both sides
        begin = max([0, *(m for m in marks if m <= first)])
        begin = max([begin, *(b for _, b in resting if b <= first)])
        end = min([len(motion.time), *(m for m in marks if m >= last)])
        end = min([end, *(a for a, _ in resting if a >= last)])
        if (first, last) in doubted:
            # another impact may precede the stretch
            begin = max(begin, first)
        place, significance = _hinge(motion, (first, last), (begin, end))
        if significance > SIGNIFICANT:
            marks.append(place)
    return away(motion, marks, resting)


def away(motion: Motion, marks: list[int], resting: list[Span]) -> list[int]:
    """Return the marks with a flight on both sides."""
    ends = [(-1, 0), (len(motion.time), len(motion.time) + 1)]
    kept: list[int] = []
    for mark in sorted(marks):
        here = (mark, mark + 1)
        if any(overlap(here, other) for other in [*resting, *ends]):
            continue
        if not kept or mark - kept[-1] >= SHORTEST_FLIGHT:
            kept.append(mark)
    return kept


def _hinge(motion: Motion, where, limits) -> tuple[int, float]:
    """Find the most likely time of a slow impact, and the significance of its velocity
    jump.

    In an impact, only the velocity jumps; the acceleration hardly changes. A cubic with
    a hinge therefore describes both sides and reveals jumps that two separate fits
    miss.
    """
    reach = round(0.02 / motion.interval)
    best = (where[0], 0.0)
    least = np.inf
    for place in range(max(where[0], limits[0] + 3), min(where[1], limits[1] - 3)):
        rows = slice(max(limits[0], place - reach), min(limits[1], place + reach))
        time = motion.time[rows] - motion.time[place] + motion.interval / 2
        if len(time) < 12:
            continue
        scaled = time / np.max(np.abs(time))
        design = np.column_stack(
            [scaled[:, None] ** np.arange(4), np.maximum(0.0, scaled)]
        )
        inverse = np.linalg.pinv(design)
        coefficients = inverse @ motion.samples[rows]
        misfit = motion.samples[rows] - design @ coefficients
        left = float(np.sum(misfit**2) / (len(time) - 5))
        if left < least:
            error = motion.noise * np.linalg.norm(inverse[4])
            least, best = left, (place, float(coefficients[4] / error))
    return best
