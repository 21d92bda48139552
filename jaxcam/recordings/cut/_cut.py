"""Find flights, contacts and impacts of a motion, with evidence for each boundary."""

import dataclasses
from collections.abc import Sequence

import numpy as np

from ._contact_stretches import (
    contact_stretches,
    HIGH,
    LOW,
    merged,
    overlap,
    SHORTEST_CONTACT,
    SIGNIFICANT,
    Span,
)
from ._given_impacts import given_places, GivenImpacts
from ._impact_marks import away, impact_marks
from ._impact_speeds import speeds
from ._kinks import WINDOW
from ._motion import Motion
from ._polynomial import crossing, LocalFit
from ._record_ends import clear_of_end, settled_alike
from ._release import release_time
from ._segments import Boundary, Contact, Flight, Impacts, impacts_of


# A supposed impact is rejected if the motion before it recedes from the surface by more
# than this many standard errors of the velocity. If the motion after an impact
# approaches the surface by more than this, several impacts are assumed
_SURE = 3.0
# Minimum number of samples that determine the curvature of a flight before an impact
_LONG = 10
# Largest gap at an impact, in units of the noise and as a fraction of the largest gap;
# this allows for a surface that is known only within its tolerance
_FAR_NOISE, _FAR_GAP = 20.0, 0.25


def cut(
    sides: Sequence[Motion],
    restitution: float,
    doubted: Sequence[Span] = (),
    given: GivenImpacts | None = None,
) -> tuple[tuple[Flight, ...], tuple[Contact, ...], Impacts]:
    """Segment a motion within one or several surfaces.

    **Arguments:**

    - `sides`: the motion relative to each surface, with a positive gap; it is
      `mirrored` for a surface above the motion, and for a moving body it is the
      distance from that body.
    - `restitution`: expected value, for impacts too weak to be observed.
    - `doubted`: stretches of samples that a model of the flight does not describe; a
        less significant impact is sought there, and a flight that follows contact
        begins at the last sample near the surface.
    - `given`: the impacts, if a model of the flights has located them.
    """
    motion = sides[0]
    if given is None:
        resting, doubtful, marks = _places(sides, doubted)
        located = {}
    else:
        resting, doubtful, marks = given_places(sides, given)
        located = given.marks(motion.time)
    while True:
        stretches = sorted([*resting, *doubtful])
        spans = _spans(len(motion.time), stretches, sorted(marks))
        before = {b: a for a, b in spans}
        after = dict(spans)
        crossed = {
            place: located[place].crossed()
            if place in located
            else _crossed(sides[number], before[place], place, after[place])
            for place, number in marks.items()
            if place in before and place in after
        }
        # a velocity jump while the motion leaves the surface is not an impact on it; a
        # mark in a doubted stretch is kept, because a model contradicts the polynomials
        long = {last for first, last in spans if last - first >= _LONG}
        wrong = [
            place
            for place in marks
            if place in crossed and place in long and _leaves(crossed[place])
            if not any(a < place < b for a, b in doubted)
        ]
        if not wrong:
            break
        for place in wrong:
            del marks[place]

    ends = {**resting, **doubtful}.items()
    side = {place: k for span, pair in ends for place, k in zip(span, pair)}
    side |= marks
    boundaries: dict[int, Boundary] = {}
    for place, found in crossed.items():
        boundaries[place] = _impact(found)
    for first, last in stretches:
        if first in before:
            here = sides[side[first]]
            fit = here.fit(before[first], first, at_end=True)
            boundaries[first] = _landing(here, first, fit)
        if last in after:
            end = after[last]
            release = _release(sides[side[last]], first, last, end)
            latest = float(motion.time[(last + end) // 2])
            if any(a < last < b for a, b in doubted):
                boundaries[last] = _still_near(float(motion.time[last]), latest)
                continue
            boundaries[last] = _not_before(boundaries.get(first), release, latest)
    for place in (0, len(motion.time)):
        boundaries[place] = _end(motion, place, "the recording ends here")

    left = {last for _, last in stretches}
    empty = [span for span in doubted if not any(span[0] < m < span[1] for m in marks)]
    flights = [_flight(sides, span, boundaries, left, empty) for span in spans]
    contacts = [
        _contact(motion, span, boundaries, flights, restitution) for span in stretches
    ]
    contacts = [
        dataclasses.replace(contact, settled=contact.stop.time)
        if span in doubtful
        else contact
        for span, contact in zip(stretches, contacts)
    ]
    contacts = settled_alike(contacts, flights)
    impacts = [
        # an impact is omitted if noise has made its approach speed negative
        ({**crossed[place], "side": marks.get(place, side.get(place, 0))}, number)
        for number, (_, place) in enumerate(spans)
        if place in crossed
        and crossed[place]["approach"] > 0
        and boundaries[place].kind == "impact"
    ]
    return tuple(flights), tuple(contacts), impacts_of(impacts)


def _places(sides: Sequence[Motion], doubted: Sequence[Span]):
    """Return contacts and doubtful contacts with the sides at their ends, and impacts
    with their side.
    """
    # gaps may have different units, so they are compared in units of their noise
    nearest = np.argmin(np.stack([side.gap / side.noise for side in sides]), axis=0)
    resting: dict[Span, int] = {}
    doubtful: dict[Span, int] = {}
    marks: dict[int, int] = {}
    for number, side in enumerate(sides):
        found, unsure = contact_stretches(side)
        for mark in impact_marks(side, found, doubted):
            # next to a jump, the comparison of windows shows spurious jumps of opposite
            # sign
            near = side.gap[mark - 1 : mark + 1]
            if number in nearest[mark - 1 : mark + 1] and np.min(near) < _reach(side):
                marks[mark] = number
        resting |= dict.fromkeys(found, number)
        doubtful |= dict.fromkeys(unsure, number)
    # doubtful stretches next to an impact or a contact are dropped; others count as
    # contact
    doubtful = {
        pair: number
        for pair, number in doubtful.items()
        if not any(overlap(pair, (mark, mark + 1)) for mark in marks)
        and not any(overlap(pair, other) for other in resting)
    }
    kept = away(sides[0], list(marks), sorted([*resting, *doubtful]))
    return *merged(resting, doubtful), {mark: marks[mark] for mark in kept}


def _reach(side: Motion) -> float:
    """Return the gap above which a velocity jump cannot be due to a given surface."""
    return max(_FAR_NOISE * side.noise, _FAR_GAP * float(np.max(side.gap)))


def _leaves(found: dict) -> bool:
    """Return whether the motion was certainly leaving the surface at a supposed
    impact.
    """
    return found["approach"] < -_SURE * found["before_stderr"]


def _spans(count: int, resting: list[Span], marks: list[int]) -> list[Span]:
    """Return the first sample and one past the last of each flight."""
    spans = []
    begin = 0
    for first, last in [*resting, (count, count)]:
        places = [begin, *(m for m in marks if begin < m < first), first]
        spans += [(a, b) for a, b in zip(places, places[1:]) if b > a]
        begin = last
    return spans


def _crossed(motion: Motion, first: int, place: int, last: int) -> dict:
    """Estimate an impact from the flights on both sides, which meet at its time."""
    before = motion.fit(first, place, at_end=True)
    after = motion.fit(place, last, at_end=False)
    origin = float(motion.time[place] - motion.interval / 2)
    reach = 5 * motion.interval
    time, stderr = crossing(before, after, origin, reach)
    shown = motion.seen is not None and place in motion.seen.jumps
    if shown and stderr > motion.interval / 2:
        time, stderr = origin, motion.interval / 2
    elif abs(time - origin) >= reach:
        time, stderr = origin, 2 * motion.interval
    surface = float(np.interp(time, motion.time, motion.rate))
    arriving, leaving = speeds(motion, (before, after), (first, place, last), time)
    approach, separation = surface - arriving.value, leaving.value - surface
    # where the fits meet, the distance from the surface is the mean of both fits with
    # these weights
    shares = np.array([separation, approach])
    shares = shares / np.sum(shares) if np.sum(shares) > 0 else np.full(2, 0.5)
    errors = np.array([before.value_stderr(time), after.value_stderr(time)])
    error = float(np.linalg.norm(shares * errors))
    return {
        "time": time,
        "time_stderr": stderr,
        "angle": motion.sense * 0.5 * (before.value(time) + after.value(time)),
        "angle_stderr": error,
        "turned": float("nan"),
        "before": motion.sense * arriving.value,
        "before_stderr": arriving.stderr,
        "after": motion.sense * leaving.value,
        "after_stderr": leaving.stderr,
        "approach": approach,
        "separation": separation,
        "surface_stderr": 0.0,
    }


def _impact(found: dict) -> Boundary:
    if found["separation"] < -_SURE * found["after_stderr"]:
        evidence = "after a velocity jump, the motion still leads into the surface"
        # the windows used to detect a jump extend this far on either side
        return Boundary(found["time"], WINDOW / 2, "several impacts", evidence)
    jump = abs(found["after"] - found["before"])
    error = np.hypot(found["before_stderr"], found["after_stderr"])
    evidence = f"the velocity jumps by {jump:.3g}, {jump / error:.0f} standard errors"
    if jump < SIGNIFICANT * error:
        evidence = "a cubic with a kink describes both sides of a slow impact"
    return Boundary(found["time"], found["time_stderr"], "impact", evidence)


def _landing(motion: Motion, place: int, before: LocalFit) -> Boundary:
    time = float(motion.time[place])
    slope = before.slope(time) - motion.rate[place]
    height = before.value(time) - motion.contact[place]
    # time from the crossing of the threshold to the impact on the surface
    shift = -height / slope if slope < 0 else 0.0
    limit = 10 * motion.interval
    time = time + float(np.clip(shift, -limit, limit))
    stderr = min(limit, before.value_stderr(time) / -slope) if slope < 0 else limit
    evidence = (
        f"the gap stays within {LOW:g} times the noise for at least "
        f"{SHORTEST_CONTACT * 1e3:g} ms; approach speed {max(0, -slope):.2g}"
    )
    return Boundary(time, float(stderr), "landing", evidence)


def _release(motion: Motion, first: int, last: int, end: int) -> Boundary:
    high = last + np.argmax(motion.gap[last:end] > 4 * HIGH * motion.noise)
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
    evidence = "from here on, the surface curves away from a free parabola"
    return Boundary(time, stderr, "release", evidence)


def _not_before(landing: Boundary | None, release: Boundary, latest) -> Boundary:
    """Return the release, or a later boundary if the follower may still be bouncing at
    the time of release.

    The rebounds of a low flight that ends on a receding surface are too low to be
    observed. The next flight begins no later than `latest` (s).
    """
    if landing is None or landing.kind != "landing":
        return release
    late = landing.time + 2 * landing.stderr
    if release.time > late:
        return release
    evidence = "flights too low to be observed may last until here"
    return Boundary(min(late, latest), landing.stderr, "impact", evidence)


def _still_near(time: float, latest: float) -> Boundary:
    """Return the end of a contact that lasts as long as the motion is near the surface.

    If this end were a release, it would begin a flight that the model does not
    describe.
    """
    evidence = "flights too low to be observed may last until here"
    return Boundary(min(time, latest), WINDOW / 2, "impact", evidence)


def _flight(sides, span, boundaries, left: set[int], doubted) -> Flight:
    motion = sides[0]
    clear = [clear_of_end(side, span) for side in sides]
    clear.append(_clear_of(doubted, span, len(motion.time)))
    first, last = max(a for a, _ in clear), min(b for _, b in clear)
    start, stop = (boundaries[place] for place in span)
    hidden = "an impact between here and the end of the recording may be undetected"
    start = start if first == span[0] else _end(motion, min(first, last - 1), hidden)
    stop = stop if last == span[1] else _end(motion, last - 1, hidden)
    height = float(np.max(motion.gap[first:last], initial=0.0))
    # the gap exceeds the threshold only long after release; the samples until then
    # belong to the flight
    begin = int(np.searchsorted(motion.time, start.time))
    first = begin if span[0] in left and start is boundaries[span[0]] else first
    return Flight(start, stop, first, last, height)


def _clear_of(doubted: Sequence[Span], span: Span, count: int) -> Span:
    """Return the part of a flight outside any doubted stretches at the ends of the
    recording; these stretches are too short to show an impact.
    """
    first, last = span
    for a, b in doubted:
        if a <= first == 0:
            first = min(b, last)
        if b >= count - 1 and last == count:
            last = max(a, first)
    return first, last


def _end(motion: Motion, place: int, why: str) -> Boundary:
    time = float(motion.time[min(place, len(motion.time) - 1)])
    return Boundary(time, float("nan"), "end of record", why)


def _contact(motion, span, boundaries, flights, restitution) -> Contact:
    first, last = span
    start, stop = boundaries[first], boundaries[last]
    settled = start.time
    before = [flight for flight in flights if flight.stop is start]
    if before and start.kind == "landing":
        settled = settling_time(before[0], restitution)
    end = int(np.searchsorted(motion.time, stop.time))
    last = last if stop.kind == "end of record" else end
    settled = stop.time if stop.kind == "impact" else min(settled, stop.time)
    return Contact(start, stop, first, last, settled)


def settling_time(flight: Flight, restitution: float) -> float:
    """Return the latest time at which the impacts after a flight have died out.

    The durations of the flights form a geometric series with the coefficient of
    restitution as its ratio.
    """
    landing = flight.stop
    late = landing.stderr if np.isfinite(landing.stderr) else 0.0
    rest = restitution / (1 - min(restitution, 0.95))
    return landing.time + late + (flight.duration + late) * rest
