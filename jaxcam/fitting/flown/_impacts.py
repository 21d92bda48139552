"""Decide with the model which impacts a recording contains.

With few samples per oscillation, a jump in velocity cannot be distinguished from
curvature without a model. The model flies from each possible impact to the next. An
impact is rejected if one flight describes the samples on both sides of it; if a flight
does not describe its samples, an impact is sought there.
"""

import dataclasses
import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from ...recordings.cut import GivenImpact
from ..engine import Parameter
from ._candidates import candidates, near_a_surface
from ._meeting import meeting
from ._windows import Flyer, Window


# An impact is accepted if it reduces the cost by more than this
_SURE = 30.0
# A flight is searched for a missed impact if its cost exceeds the expected one by this
# many standard deviations. The impact must explain at least this part of the excess
_UNLIKELY, _EXPLAINED = 5.0, 0.5
# Multiple of the usual cost per reading up to which a flight describes its samples
_UNUSUAL = 2.0
# Costs above this multiple of the median count with less weight for the parameters
_ROBUST = 4.0
# Rounds of rejection and search, and steps of the parameters in the first round
_ROUNDS, _STEPS = 12, 4
# Distance (in samples) from a candidate within which samples may be on either side, and
# from an impact that two flights have located
_UNCLEAR, _LOCATED = 0.6, 0.1
# Standard error (in samples) of the place of an impact that is located
_SHARP = 0.25
# Assessments in a row that only move impacts, and the move (in samples) that ends them
_SETTLING, _SETTLED = 5, 0.2
# Fewest samples of a flight; impacts in one oscillation that are told apart at first
_LEAST, _CLOSEST = 3, 40


@dataclasses.dataclass(frozen=True)
class _Mark:
    """A possible impact, or a contact: its place and the half-width of its doubtful
    samples, in samples; the decrease of the cost that it causes.
    """

    place: float
    margin: float = _UNCLEAR
    gain: float = math.inf
    met: GivenImpact | None = None
    contact: bool = False

    @classmethod
    def resting(cls, first: int, last: int) -> "_Mark":
        """Return a contact, which no flight enters."""
        return cls((first + last - 1) / 2, (last - first) / 2, contact=True)

    @property
    def last(self) -> int:
        """Number of samples certainly before the impact, counted from the first."""
        return math.ceil(self.place - self.margin)

    @property
    def first(self) -> int:
        """First sample certainly after the impact."""
        return math.floor(self.place + self.margin) + 1


class Search:
    """The search for the impacts of one recording.

    **Arguments:** the gaps at every sample `(g, k)`, their noises and largest errors
    `(g,)`; the number of samples in one oscillation.
    """

    def __init__(
        self,
        flyer: Flyer,
        parameters: Sequence[Parameter],
        gaps: Float[np.ndarray, "g k"],
        noises: Float[np.ndarray, " g"],
        errors: Float[np.ndarray, " g"],
        reach: int,
    ):
        self.flyer = flyer
        self.nominal = np.array(flyer.values)
        spread = np.array([p.prior_stderr for p in parameters])
        # reshaped, because `diag` of no numbers has the wrong shape
        prior = np.diag((flyer.sizes / spread) ** 2)
        self.prior = prior.reshape(len(spread), len(spread))
        self.bounds = np.array([(p.lower, p.upper) for p in parameters]).reshape(-1, 2)
        self.information = self.prior
        self.count = gaps.shape[1]
        self.reach = reach
        self.scale = 1.0
        self.near = near_a_surface(gaps, noises, errors)
        found = candidates(gaps, noises, errors, max(1, reach // _CLOSEST))
        self.marks = [_Mark(float(k)) for k in found]
        self.refused: set[int] = set()

    def run(self) -> list[GivenImpact]:
        """Return the impacts, in order."""
        for _ in range(_STEPS):
            self._adjust()
        for _ in range(_ROUNDS):
            self._reject()
            if not self._insert():
                break
        else:
            self._reject()
        return [mark.met for mark in self.marks if mark.met is not None]

    def again(self, contacts: Sequence[tuple[int, int]]) -> list[GivenImpact]:
        """Return the impacts outside the given contacts."""
        outside = [
            mark
            for mark in self.marks
            if not any(a - 1 <= mark.place <= b for a, b in contacts)
        ]
        blocked = [_Mark.resting(*span) for span in contacts]
        self.marks = sorted([*outside, *blocked], key=lambda mark: mark.place)
        return self.run()

    def described(self) -> Bool[np.ndarray, " k"]:
        """Return whether a flight describes each sample."""
        found = np.zeros(self.count, dtype=bool)
        pieces = self._pieces()
        if not pieces:
            return found
        flights = self.flyer.fly(pieces, self._precision())
        each = flights.cost / np.maximum(flights.count - self._size, 1)
        for (a, b), one in zip(pieces, each):
            # a sample next to an impact belongs to one of the flights
            found[max(a - 1, 0) : b + 1] |= one < _UNUSUAL * self.scale
        return found

    def _reject(self) -> None:
        """Reject impacts until each of those that remain is significant and in its
        place.
        """
        settling = 0
        while settling < _SETTLING:
            self._adjust()
            moved = self._assess()
            if self._drop():
                settling = 0
            elif moved < _SETTLED:
                break
            else:
                settling += 1

    # windows

    def _between(self, marks: Sequence[_Mark]) -> list[Window]:
        """Return the samples of each flight."""
        edges = [0, *(m.first for m in marks)], [*(m.last for m in marks), self.count]
        return [(a, max(b, a)) for a, b in zip(*edges)]

    def _pieces(self) -> list[Window]:
        """Return windows that cover all flights, none longer than the reach allows."""
        found = []
        for a, b in self._between(self.marks):
            if b - a < _LEAST:
                continue
            number = math.ceil((b - a) / (2 * self.reach))
            edges = np.linspace(a, b, number + 1).astype(int)
            found += [(int(x), int(y)) for x, y in zip(edges, edges[1:])]
        return found

    def _precision(self):
        return self.information / self.scale

    # parameters

    def _adjust(self) -> None:
        """Take a step of the parameters towards those that describe the flights."""
        pieces = self._pieces()
        if not pieces:
            return
        found = self.flyer.fly(pieces, None)
        free = found.count - self._size
        each = found.cost / np.maximum(free, 1)
        long = free >= 4
        usual = float(np.median(each[long])) if np.any(long) else 1.0
        self.scale = max(1.0, usual)
        if not len(self.nominal):
            return
        weight = np.minimum(1.0, _ROBUST * self.scale / np.maximum(each, 1e-300))
        weight = np.where(free > 0, weight, 0.0) / self.scale
        off = (self.flyer.values - self.nominal) / self.flyer.sizes
        left = np.einsum("b,bpq->pq", weight, found.normal)
        right = np.einsum("b,bp->p", weight, found.target) - self.prior @ off
        self.information = left + self.prior
        change = np.linalg.lstsq(self.information, right, rcond=1e-12)[0]
        values = self.flyer.values + self.flyer.sizes * change
        values = np.clip(values, self.bounds[:, 0], self.bounds[:, 1])
        self.flyer = self.flyer._replace(values=values)

    @property
    def _size(self) -> int:
        return self.flyer.record.guess.shape[1]

    # impacts

    def _assess(self) -> float:
        """Locate every possible impact, and compute its gain. Return the largest move
        of an impact, in samples.
        """
        if not self.marks:
            return 0.0
        moved = 0.0
        flights = self._between(self.marks)
        windows: list[Window] = []
        for before, after in zip(flights, flights[1:]):
            a, b = max(before[0], before[1] - self.reach), before[1]
            c, d = after[0], min(after[1], after[0] + self.reach)
            windows += [(a, b), (c, d), (a, d)]
        found = self.flyer.fly(windows, self._precision())
        interval = float(self.flyer.record.interval)
        for k, mark in enumerate(self.marks):
            left, right, both = 3 * k, 3 * k + 1, 3 * k + 2
            gain = found.cost[both] - found.cost[left] - found.cost[right]
            more = found.count[both] - found.count[left] - found.count[right]
            gain = float(gain - more) / self.scale
            bounds = windows[left][1] - 1, windows[right][0]
            extent = self.flyer.margin - 2
            met = meeting(found, left, right, bounds, interval, extent)
            if mark.contact:
                continue
            if met is None:
                self.marks[k] = _Mark(mark.place, _UNCLEAR, min(gain, 0.0))
                continue
            place = met.time / interval
            sharp = met.time_stderr < _SHARP * interval
            margin = _LOCATED if sharp else _UNCLEAR
            self.marks[k] = _Mark(place, margin, gain, met)
            moved = max(moved, abs(place - mark.place))
        self.marks.sort(key=lambda mark: mark.place)
        return moved

    def _drop(self) -> bool:
        """Reject the impacts without which the flights fit as well; of neighbours, only
        the least significant one.
        """
        gains = np.array([-np.inf, *(m.gain for m in self.marks), -np.inf])
        gains[[0, -1]] = np.inf
        low = gains[1:-1] < _SURE
        least = low & (gains[1:-1] <= gains[:-2]) & (gains[1:-1] < gains[2:])
        # between two impacts, there is a flight
        for k, (one, other) in enumerate(zip(self.marks, self.marks[1:])):
            short = other.last - one.first < _LEAST
            if short and not (one.contact or other.contact):
                least[k if one.gain < other.gain else k + 1] = True
        if np.any(low) and not np.any(least):
            least[int(np.argmin(gains[1:-1]))] = True
        self.marks = [m for m, out in zip(self.marks, least) if not out]
        return bool(np.any(least))

    def _insert(self) -> bool:
        """Add the impact that best explains the misfit of each flight."""
        pieces = self._pieces()
        if not pieces:
            return False
        found = self.flyer.fly(pieces, self._precision())
        free = np.maximum(found.count - self._size, 1)
        usual = free + _UNLIKELY * np.sqrt(2.0 * free)
        added = []
        for (a, b), cost, most, count in zip(pieces, found.cost, usual, found.count):
            if cost < most * self.scale or cost - count < _SURE * self.scale:
                continue
            places = [
                k
                for k in range(a + 1, b)
                if self.near[k - 1 : k + 1].any() and k not in self.refused
            ]
            if not places:
                continue
            windows = [w for k in places for w in ((a, k), (k, b))]
            parts = self.flyer.fly(windows, self._precision())
            gains = cost - parts.cost[::2] - parts.cost[1::2]
            best = int(np.argmax(gains))
            excess = max(float(cost - count), 0.0)
            if gains[best] > max(_SURE * self.scale, _EXPLAINED * excess):
                added.append(_Mark(places[best] - 0.5))
                self.refused.add(places[best])
        self.marks = sorted([*self.marks, *added], key=lambda mark: mark.place)
        return bool(added)
