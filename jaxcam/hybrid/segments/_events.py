"""Locate the first event in a piece of motion computed by diffrax, by Newton's method.

Each step is checked at interior points, which are computed by separate steps; Newton's
method then varies the length of such a step.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ._motion import CompiledMotion, FRACTIONS


class PieceEnd(NamedTuple):
    """The event that ends a piece: its constraint, the row of the last point before it,
    and the time from that point to the event (s).
    """

    constraint: int
    row: int
    length: float


TOO_LONG = PieceEnd(-1, 0, 0.0)
"""The step after an event was longer than the flight: retry with a shorter one."""


class Flown(NamedTuple):
    """Points of a piece of motion: `k` times (s) and states of size `n`, and which of
    the `m` constraints stay in contact. The level is the gap in flight and the contact
    pressure in contact; `tiny` is the resolution of each gap or, for a contact, a
    fraction of the largest level.
    """

    motion: CompiledMotion
    contact: Bool[np.ndarray, " m"]
    times: Float[np.ndarray, " k"]
    states: Float[np.ndarray, "k n"]
    tiny: Float[np.ndarray, " m"]

    def first_event(self, count, fired, first, first_rate, t1) -> PieceEnd | None:
        """Return the first event in the steps; `TOO_LONG` if the first step has passed
        over one.

        **Arguments:** the number of points, whether diffrax `fired` an event at the
        last of them, levels and rates `(m,)` at the first, and the end of the run (s).
        """
        times = self.times
        scan = self.motion.scan(times, self.states, self.contact, count - 1)
        level, rate = np.asarray(scan.level), np.asarray(scan.rate)
        found: list[PieceEnd] = []
        for k in range(len(self.contact)):
            curve = level[: count - 1, :, k], rate[: count - 1, :, k]
            largest = np.max(np.abs(curve[0]), initial=np.abs(first[k]))
            tiny = 1e-12 * largest if self.contact[k] else self.tiny[k]
            event = self._crossing(k, curve, first[k], first_rate[k], tiny)
            if event is TOO_LONG:
                return event
            if event is None and fired:
                # the piece ends at the event, beyond which nothing was checked
                end, slope, i = curve[0][-1, -1], curve[1][-1, -1], count - 2
                h = float(times[i + 1] - times[i])
                # diffrax locates the event only to within the error of its interpolant
                if slope < 0 and end <= -slope * 1e-2 * h + 10 * tiny:
                    event = self._locate(k, i, 0.0, None, h)
            if event is not None:
                # no step ends after t1, so an event after t1 is due to rounding
                length = min(event.length, t1 - times[event.row])
                found.append(event._replace(length=float(length)))
        return min(found, key=lambda e: times[e.row] + e.length, default=None)

    def _crossing(self, k, curve, before, slope, tiny):
        """Return the first event at which the level of constraint `k` falls below zero;
        `TOO_LONG` if the event is too close to a start on the surface, and `None` if
        there is no event.
        """
        if before <= tiny:
            # the motion starts on the surface and leaves it, so a negative rate is a
            # rounding error
            slope = max(slope, 0.0)
        started_on_surface = before <= tiny
        for i, (levels, rates) in enumerate(zip(*curve, strict=True)):
            lengths = FRACTIONS * float(self.times[i + 1] - self.times[i])
            low = 0.0
            for p, high in enumerate(lengths):
                bottom, lowest = high, levels[p]
                steepest = max(-slope, rates[p])
                if slope < 0 < rates[p] and (
                    min(before, levels[p]) < (high - low) * steepest
                ):
                    bottom = self._bottom(k, i, low, high)
                    lowest = float(self.probe(i, bottom).level[k])
                if lowest < -tiny / 10:
                    if i == 0 and p == 0 and started_on_surface:
                        return TOO_LONG
                    return self._locate(k, i, low, bottom)
                before, slope, low = levels[p], rates[p], high
        return None

    def _locate(self, k, i, low, high, start=None) -> PieceEnd:
        """Return the event after point `i`; Newton's method finds the time from that
        point, `length` (s), between `low` and `high`.
        """
        h = high if start is None else start
        change, span = np.inf, float(self.times[i + 1] - self.times[i])
        for _ in range(60):
            there = self.probe(i, h)
            level, slope = float(there.level[k]), float(there.rate[k])
            if high is not None:
                low, high = (h, high) if level > 0 else (low, h)
            moved = h - level / slope if slope < 0 else -np.inf
            if high is not None and not low <= moved <= high:
                moved = (low + high) / 2
            if not np.isfinite(moved):
                break
            smaller = abs(moved - h) < 0.5 * change
            change, h = abs(moved - h), moved
            if change <= 1e-15 * h or (not smaller and change < 1e-12 * (span + h)):
                break
        return PieceEnd(k, i, float(h))

    def _bottom(self, k, i, low, high):
        """Return where the level is lowest between two lengths, by bisection of its
        rate.
        """
        for _ in range(50):
            middle = (low + high) / 2
            falls = self.probe(i, middle).rate[k] < 0
            low, high = (middle, high) if falls else (low, middle)
        return high

    def probe(self, i, h):
        """Return the state, levels and rates at a time `h` (s) after point `i`."""
        return self.motion.probe(self.times[i], self.states[i], self.contact, h)
