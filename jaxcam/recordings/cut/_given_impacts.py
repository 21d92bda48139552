"""Impacts that a model of the flights has located, in place of velocity jumps."""

import dataclasses
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ._contact_stretches import (
    contact_stretches,
    merged,
    overlap,
    SHORTEST_FLIGHT,
    Span,
)
from ._motion import Motion
from ._placed import shifted


class GivenImpact(NamedTuple):
    """An impact as the flights before and after it show it.

    Speeds are rates of change of the gap, negative before the impact and positive after
    it.
    """

    time: float
    """Time (s)."""
    time_stderr: float
    """Standard error of `time` (s)."""
    side: int
    """Index of the gap that closes."""
    gap: float
    """Gap at the impact."""
    gap_stderr: float
    """Standard error of `gap`."""
    before: float
    """Rate of change of the gap before the impact."""
    before_stderr: float
    """Standard error of `before`."""
    after: float
    """Rate of change of the gap after the impact."""
    after_stderr: float
    """Standard error of `after`."""

    def crossed(self) -> dict:
        """Return the entries of the table of impacts."""
        return {
            "time": self.time,
            "time_stderr": self.time_stderr,
            "angle": self.gap,
            "angle_stderr": self.gap_stderr,
            "turned": float("nan"),
            "before": self.before,
            "before_stderr": self.before_stderr,
            "after": self.after,
            "after_stderr": self.after_stderr,
            "approach": -self.before,
            "separation": self.after,
            "surface_stderr": 0.0,
        }


@dataclasses.dataclass(frozen=True)
class GivenImpacts:
    """The impacts of a recording, and the samples that the flights describe."""

    impacts: tuple[GivenImpact, ...]
    described: Bool[np.ndarray, " k"]

    def placed(self, side: int, motion: Motion, tolerance: float) -> Motion:
        """Return the motion with its surface shifted to the impacts on it."""
        found = [one for one in self.impacts if one.side == side]
        gaps = np.array([one.gap for one in found])
        errors = np.array([one.gap_stderr for one in found])
        return shifted(motion, gaps, errors, tolerance)

    def marks(self, time: Float[np.ndarray, " k"]) -> dict[int, GivenImpact]:
        """Return the impacts by the index of the first sample after each of them; of
        impacts between the same two samples, the first one.
        """
        found: dict[int, GivenImpact] = {}
        for one in self.impacts:
            place = int(np.searchsorted(time, one.time))
            if 0 < place < len(time):
                found.setdefault(place, one)
        return found

    def contacts(self, motion: Motion) -> list[Span]:
        """Return the contacts on a surface: the stretches near it, however short, that
        are not part of one or two flights, and the flights before them that are too
        short to be described.
        """
        places = sorted(self.marks(motion.time))
        found: list[Span] = []
        # the model decides about doubtful stretches, too
        for first, last in sorted(sum(contact_stretches(motion, least=0.0), [])):
            inside = [place for place in places if first - 1 <= place <= last + 1]
            if np.all(self.described[first:last]) and len(inside) <= 1:
                continue
            for place in reversed(places):
                if first - SHORTEST_FLIGHT <= place < first:
                    first = place
            found.append((first, last))
        return found


def given_places(sides, given: GivenImpacts):
    """Return contacts with the sides at their ends, and impacts with their side."""
    resting: dict[Span, int] = {}
    for number, side in enumerate(sides):
        resting |= dict.fromkeys(given.contacts(side), number)
    marks = {
        place: one.side
        for place, one in given.marks(sides[0].time).items()
        if not any(overlap((place, place + 1), span) for span in resting)
    }
    return *merged(resting, {}), marks
