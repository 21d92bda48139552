"""Where to cut: the rule, and the evidence for each cut.

The rule has two thresholds and a duration, so that noise alone makes no cut: a
contact stays within four times the noise for 5 ms; a flight rises above six times the
noise. A jump in velocity cuts a flight in two, however fast the impact is over.
"""

import dataclasses
from typing import TypeAlias

import numpy as np
from jaxtyping import Float
from scipy.ndimage import binary_closing

from ._kinks import find_kinks
from ._polynomial import crossing, fit_local, LocalFit
from ._release import release_time
from ._segments import Boundary, Contact, Flight, Impacts
from ._surface import stretches


# First sample of a stretch, and one past its last
Span: TypeAlias = tuple[int, int]

_LOW, _HIGH = 4.0, 6.0
_SHORTEST_CONTACT = 0.005
# Longest stretch (s) that a cubic follows within the noise of a good encoder
_FIT_WINDOW = 0.1
# A stretch near the surface that is shorter than this (s) may be a graze
_GRAZE = 0.03
# Standard errors by which a slope or a curvature must differ from zero
_SIGNIFICANT = 5.0
# Fewest samples in a flight
_SHORTEST_FLIGHT = 5


@dataclasses.dataclass(frozen=True)
class Motion:
    """Samples of a motion, what they would be in contact, and the noise on them."""

    time: Float[np.ndarray, " k"]
    samples: Float[np.ndarray, " k"]
    contact: Float[np.ndarray, " k"]
    rate: Float[np.ndarray, " k"]
    noise: float
    interval: float

    @property
    def gap(self) -> Float[np.ndarray, " k"]:
        return self.samples - self.contact

    def fit(self, first: int, last: int, *, at_end: bool) -> LocalFit:
        """A polynomial through one end of a flight."""
        # the samples next to an impact may be from the other side of it
        inner = slice(first + 1, last - 1) if last - first > 6 else slice(first, last)
        count = max(4, round(_FIT_WINDOW / self.interval))
        rows = np.arange(len(self.time))[inner]
        rows = rows[-count:] if at_end else rows[:count]
        origin = float(self.time[min(last, len(self.time) - 1) if at_end else first])
        return fit_local(self.time[rows], self.samples[rows], self.noise, origin)


def cut(
    motion: Motion, restitution: float
) -> tuple[tuple[Flight, ...], tuple[Contact, ...], Impacts]:
    """Flights, contacts and impacts of a motion.

    **Arguments:**

    - `restitution`: expected, for the bounces that are too low to be seen.
    """
    resting, doubtful = _contact_stretches(motion)
    marks = _impact_marks(motion, resting)
    # what is near the surface for long, without an impact, is no flight either
    doubtful = [
        pair
        for pair in doubtful
        if not any(_overlap(pair, (mark, mark + 1)) for mark in marks)
        and not any(_overlap(pair, other) for other in resting)
    ]
    resting = sorted([*resting, *doubtful])
    marks = _away(motion, marks, resting)
    spans = _spans(len(motion.time), resting, marks)
    before = {last: motion.fit(first, last, at_end=True) for first, last in spans}
    after = {first: motion.fit(first, last, at_end=False) for first, last in spans}

    boundaries: dict[int, Boundary] = {}
    for place in before.keys() & after.keys():
        boundaries[place] = _impact(motion, place, before[place], after[place])
    for first, last in resting:
        if first in before:
            boundaries[first] = _landing(motion, first, before[first])
        if last in after:
            end = next(stop for start, stop in spans if start == last)
            boundaries[last] = _release(motion, first, last, end)
    for place in (0, len(motion.time)):
        time = float(motion.time[min(place, len(motion.time) - 1)])
        why = "the record ends here"
        boundaries[place] = Boundary(time, float("nan"), "end of record", why)

    flights = [_flight(motion, span, boundaries) for span in spans]
    contacts = [
        _contact(motion, span, boundaries, flights, restitution) for span in resting
    ]
    contacts = [
        dataclasses.replace(contact, settled=contact.stop.time)
        if span in doubtful
        else contact
        for span, contact in zip(resting, contacts)
    ]
    contacts = _settled_alike(contacts, flights)
    impacts = [
        (_crossed(motion, place, before[place], after[place]), number)
        for number, (_, place) in enumerate(spans)
        if place in after
    ]
    return tuple(flights), tuple(contacts), _gather(impacts)


def _contact_stretches(motion: Motion) -> tuple[list[Span], list[Span]]:
    """Stretches near the surface that last, with lower bounces between them.

    And those that may as well be slow impacts, or grazes.
    """
    near = motion.gap < _LOW * motion.noise
    # one outlier in thousands of samples is no flight
    near = binary_closing(np.pad(near, 3, mode="edge"), np.ones(3))[3:-3]
    shortest = max(4, round(_SHORTEST_CONTACT / motion.interval))
    long = [pair for pair in stretches(near) if pair[1] - pair[0] >= shortest]
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
        low = np.max(motion.gap[between], initial=-np.inf) < _HIGH * motion.noise
        if low and (joined or first < _SHORTEST_FLIGHT):
            first = joined.pop()[0] if joined else 0
        joined.append((first, last))
    if joined and len(near) - joined[-1][1] < _SHORTEST_FLIGHT:
        joined[-1] = (joined[-1][0], len(near))
    return joined, doubtful


def _overlap(one: Span, other: Span) -> bool:
    """Whether two stretches are closer than the shortest flight."""
    margin = _SHORTEST_FLIGHT
    return one[0] - margin < other[1] and other[0] < one[1] + margin


def _grazes(motion: Motion, first: int, last: int) -> bool:
    """Whether a short stretch near the surface is the bottom of a parabola."""
    inside = motion.time[first:last]
    if len(inside) * motion.interval > _GRAZE or first == 0 or last == len(motion.time):
        return False
    scaled = np.linspace(-1.0, 1.0, len(inside))
    inverse = np.linalg.pinv(scaled[:, None] ** np.arange(3))
    curvature = inverse[2] @ motion.gap[first:last]
    error = motion.noise * np.sqrt(np.sum(inverse[2] ** 2))
    return bool(curvature > _SIGNIFICANT * error)


def _bounces(motion: Motion, first: int, last: int, end: int) -> bool:
    """Whether a short stretch near the surface is a slow impact.

    The flight after an impact is bent down from its first sample, or it would not
    have come; the flight after a release opens as a cubic and is bent up.
    """
    flight = motion.gap[last:end]
    if (
        (last - first) * motion.interval > _GRAZE
        or first == 0
        or np.max(flight, initial=0.0) < _HIGH * motion.noise
    ):
        return False
    reach = max(8, round(0.02 / motion.interval))
    rows = slice((first + last) // 2, min(last + reach, end))
    scaled = np.linspace(-1.0, 1.0, len(motion.gap[rows]))
    inverse = np.linalg.pinv(scaled[:, None] ** np.arange(3))
    return bool(inverse[2] @ motion.gap[rows] < 0)


def _impact_marks(motion: Motion, resting) -> list[int]:
    """Index of the first sample after each impact between two flights."""
    kinks = find_kinks(motion.samples, motion.interval, motion.noise)
    marks = [int(kink) for kink in kinks]
    near = stretches(motion.gap < _LOW * motion.noise)
    for first, last in near:
        taken = [*resting, *((mark, mark + 1) for mark in marks)]
        if any(_overlap((first, last), other) for other in taken):
            continue
        # only samples that belong to the flights on both sides
        begin = max([0, *(m for m in marks if m <= first)])
        begin = max([begin, *(b for _, b in resting if b <= first)])
        end = min([len(motion.time), *(m for m in marks if m >= last)])
        end = min([end, *(a for a, _ in resting if a >= last)])
        place, significance = _hinge(motion, (first, last), (begin, end))
        if significance > _SIGNIFICANT:
            marks.append(place)
    return _away(motion, marks, resting)


def _away(motion: Motion, marks: list[int], resting: list[Span]) -> list[int]:
    """Marks that leave a flight on both sides."""
    ends = [(-1, 0), (len(motion.time), len(motion.time) + 1)]
    kept: list[int] = []
    for mark in sorted(marks):
        here = (mark, mark + 1)
        if any(_overlap(here, other) for other in [*resting, *ends]):
            continue
        if not kept or mark - kept[-1] >= _SHORTEST_FLIGHT:
            kept.append(mark)
    return kept


def _hinge(motion: Motion, where, limits) -> tuple[int, float]:
    """The best place of a slow impact, and the significance of its jump in velocity.

    Only the velocity jumps in an impact; the acceleration hardly changes. So one cubic
    and a hinge describe both sides, which finds jumps that two separate fits miss.
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


def _spans(count: int, resting: list[Span], marks: list[int]) -> list[Span]:
    """First sample and one past the last of each flight."""
    spans = []
    begin = 0
    for first, last in [*resting, (count, count)]:
        places = [begin, *(m for m in marks if begin < m < first), first]
        spans += [(a, b) for a, b in zip(places, places[1:]) if b > a]
        begin = last
    return spans


def _crossed(motion: Motion, place: int, before: LocalFit, after: LocalFit) -> dict:
    """What the fits on both sides say about an impact; they meet at its time."""
    origin = float(motion.time[place] - motion.interval / 2)
    reach = 5 * motion.interval
    time, stderr = crossing(before, after, origin, reach)
    if abs(time - origin) >= reach:
        time, stderr = origin, 2 * motion.interval
    surface = float(np.interp(time, motion.time, motion.rate))
    approach, separation = surface - before.slope(time), after.slope(time) - surface
    # the fits meet at a weighted mean of both, as seen from the surface
    shares = np.array([separation, approach])
    shares = shares / np.sum(shares) if np.sum(shares) > 0 else np.full(2, 0.5)
    errors = np.array([before.value_stderr(time), after.value_stderr(time)])
    error = float(np.linalg.norm(shares * errors))
    return {
        "time": time,
        "time_stderr": stderr,
        "angle": 0.5 * (before.value(time) + after.value(time)),
        "angle_stderr": error,
        "turned": float("nan"),
        "before": before.slope(time),
        "before_stderr": before.slope_stderr(time),
        "after": after.slope(time),
        "after_stderr": after.slope_stderr(time),
        "approach": approach,
        "separation": separation,
        "surface_stderr": 0.0,
    }


def _impact(motion: Motion, place: int, before: LocalFit, after: LocalFit) -> Boundary:
    found = _crossed(motion, place, before, after)
    jump = found["after"] - found["before"]
    error = np.hypot(found["before_stderr"], found["after_stderr"])
    evidence = f"the velocity jumps by {jump:.3g}, {jump / error:.0f} standard errors"
    if jump < _SIGNIFICANT * error:
        evidence = "a cubic with a hinge describes both sides of a slow impact"
    return Boundary(found["time"], found["time_stderr"], "impact", evidence)


def _landing(motion: Motion, place: int, before: LocalFit) -> Boundary:
    time = float(motion.time[place])
    slope = before.slope(time) - motion.rate[place]
    height = before.value(time) - motion.contact[place]
    # how far before or after the threshold the flight meets the surface
    shift = -height / slope if slope < 0 else 0.0
    limit = 10 * motion.interval
    time = time + float(np.clip(shift, -limit, limit))
    stderr = before.value_stderr(time) / abs(slope) if slope < 0 else limit
    evidence = (
        f"the gap stays within {_LOW:g} times the noise for "
        f"{_SHORTEST_CONTACT * 1e3:g} ms and more; approach speed {max(0, -slope):.2g}"
    )
    return Boundary(time, float(stderr), "landing", evidence)


def _release(motion: Motion, first: int, last: int, end: int) -> Boundary:
    high = last + np.argmax(motion.gap[last:end] > 4 * _HIGH * motion.noise)
    stop = min(end, max(int(high), last + 8))
    begin = max(first, last - round(0.06 / motion.interval))
    rows = slice(begin, stop)
    time, stderr = release_time(
        motion.time[rows],
        motion.gap[rows],
        motion.contact[rows],
        motion.rate[rows],
        motion.noise,
    )
    evidence = "the surface bends away from a free parabola from here"
    return Boundary(time, stderr, "release", evidence)


def _flight(motion: Motion, span, boundaries) -> Flight:
    first, last = span
    start, stop = boundaries[first], boundaries[last]
    height = float(np.max(motion.gap[first:last]))
    # the threshold is passed long after release: give those samples to the flight
    begin = int(np.searchsorted(motion.time, start.time))
    first = begin if start.kind == "release" else first
    return Flight(start, stop, first, last, height)


def _contact(motion, span, boundaries, flights, restitution) -> Contact:
    first, last = span
    start, stop = boundaries[first], boundaries[last]
    settled = start.time
    before = [flight for flight in flights if flight.stop is start]
    if before and start.kind == "landing":
        # bounces shrink by r in duration: the rest of a geometric series
        rest = restitution / (1 - min(restitution, 0.95))
        settled += before[0].duration * rest
    end = int(np.searchsorted(motion.time, stop.time))
    last = min(last, end) if stop.kind == "release" else last
    return Contact(start, stop, first, last, min(settled, stop.time))


def _settled_alike(contacts: list[Contact], flights: list[Flight]) -> list[Contact]:
    """Contacts whose beginning was not seen settle as late as the others of a record.

    Where a record begins, the follower may be in the midst of bounces.
    """
    long = [f.stop for f in flights if f.last - f.first > _SHORTEST_FLIGHT]
    seen = [any(contact.start is stop for stop in long) for contact in contacts]
    known = [c.settled - c.start.time for c, one in zip(contacts, seen) if one]
    longest = max(known, default=0.0)
    return [
        contact
        if one
        else dataclasses.replace(
            contact, settled=min(contact.start.time + longest, contact.stop.time)
        )
        for contact, one in zip(contacts, seen)
    ]


def _gather(found: list[tuple[dict, int]]) -> Impacts:
    names = [f.name for f in dataclasses.fields(Impacts) if f.name != "flight"]
    columns = {name: np.array([row[name] for row, _ in found]) for name in names}
    return Impacts(**columns, flight=np.array([n for _, n in found], dtype=int))
