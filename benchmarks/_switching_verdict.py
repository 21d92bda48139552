"""Compare a run of jaxcam with the exact motion.

The exact motion is computed three times: once unchanged, and twice with opposite
changes of about 1e-8 at the start and after each event. The largest difference so far,
divided by 1e-8, is the growth of errors (at least one); a run may differ by 1e-9 times
this growth. The comparison ends before the first event that the three motions do not
share (grazing), where the growth exceeds 1e4, at an impact slower than 1e-6 that occurs
only in the run or only in the exact motion, and where impacts accumulate on a body with
a friction force normal to the wall, which jaxcam does not sum (docs/switching.md).
"""

from typing import NamedTuple

import numpy as np

import jaxcam
from jaxcam.hybrid import Settings

from ._switching_draw import Problem
from ._switching_events import described, differ, distance, events_of, LATE, listed
from ._switching_exact import Event, Exact, HITS, motion, Noise, Programs
from ._switching_invariants import broken


# permitted error of times and states, relative to the growth of errors
ALLOWED = 1e-9
SETTINGS = Settings(tolerance=1e-12)
_NOISE, _LOST = 1e-8, 1e4
# the comparison ends this much before an event that is not known
_BEFORE = 1e-3
# an impact slower than this, in only one of the motions, grazes
_SLOW = 1e-6


class Verdict(NamedTuple):
    """The result of one problem."""

    # "agrees", "grazes", "ambiguous" (several motions from the start) or "DISAGREES"
    label: str
    what: str
    # fraction of the span that was compared, and the number of events
    compared: float
    events: int
    # largest error of a time, and largest ratio of an error to its allowance
    error: float
    worst: float


class Known(NamedTuple):
    """The exact motion, where the comparison ends, and the growth of errors."""

    exact: Exact
    events: list[Event]
    end: float
    # growth at each event, and at the end
    growth: np.ndarray
    # the graze or the growth that ends the comparison, or an empty string
    graze: str


def know(problem: Problem) -> Known:
    """The exact motion of a problem, and the time up to which it is known."""
    programs = Programs(problem.linear)
    exact = motion(programs, problem.state, problem.span, ends=problem.ends)
    events = listed(exact.events)
    growth = np.ones(len(events) + 1)
    end, graze = exact.end - (LATE if exact.reason else 0.0), ""
    for sign in (1, -1):
        noise = Noise(np.random.default_rng(0), sign * _NOISE)
        other = motion(programs, problem.state, problem.span, noise, problem.ends)
        others = listed(other.events)
        for i in range(max(len(events), len(others))):
            pair = events[i : i + 1] + others[i : i + 1]
            if len(pair) < 2 or pair[0][1:3] != pair[1][1:3]:
                first = min(e.time for e in pair)
                if first < end:
                    end = first - _BEFORE
                    graze = f"{described(events[i:])}, or {described(others[i:])}"
                break
            growth[i] = max(growth[i], differ(*pair) / _NOISE)
        if len(events) == len(others) and other.end == exact.end:
            growth[-1] = max(growth[-1], distance(exact.final, other.final) / _NOISE)
    growth = np.maximum.accumulate(growth)
    lost = [e.time for e, g in zip(events, growth, strict=False) if g > _LOST]
    if lost and lost[0] <= end:
        end, graze = lost[0] - _BEFORE, "errors grow"
    return Known(exact, events, end, growth, graze)


def judge(problem: Problem, known: Known, settings: Settings = SETTINGS) -> Verdict:
    """Compare a run of jaxcam with what is known."""
    exact, end = known.exact, known.end
    if end <= 0 and exact.reason:
        return Verdict("ambiguous", exact.reason, 0.0, 0, 0.0, 0.0)
    run = jaxcam.simulate(
        problem.system, problem.state, 0.0, problem.span, settings=settings
    )
    compared, count = max(end, 0.0) / problem.span, 0
    stopped = float(np.asarray(run.steps.time)[-1])

    def wrong(what: str) -> Verdict:
        return Verdict("DISAGREES", what, compared, count, np.inf, np.inf)

    if stopped < end:
        return wrong(f"ends at {stopped:.9g} of {end:.9g}: {run.result}")
    said = broken(problem, run, end)
    if said:
        return wrong(said)
    mine = [e for e in known.events if e.time < end]
    theirs = [e for e in listed(events_of(run)) if e.time < end]
    error = worst = 0.0
    for count in range(max(len(mine), len(theirs))):
        pair = mine[count : count + 1] + theirs[count : count + 1]
        if len(pair) < 2 or pair[0][1:3] != pair[1][1:3]:
            both = described(mine[count:]), described(theirs[count:])
            first = min(pair, key=lambda e: e.time)
            if first.kind == HITS and abs(first.speed) < _SLOW:
                compared = first.time / problem.span
                return Verdict("grazes", str(both), compared, count, error, worst)
            return wrong(f"exact {both[0]}, jaxcam {both[1]}")
        late, off = abs(pair[0].time - pair[1].time), differ(*pair)
        growth = known.growth[count]
        error, worst = max(error, late), max(worst, off / (ALLOWED * growth))
        if worst > 1:
            return wrong(f"{described(mine[count:])}: {off:.1e}, growth {growth:.1e}")
    count = len(mine)
    if end == problem.span:
        off = distance(exact.final, np.asarray(run.final))
        worst = max(worst, off / (ALLOWED * known.growth[-1]))
        if worst > 1:
            return wrong(f"final state: {off:.1e}, growth {known.growth[-1]:.1e}")
    label = "grazes" if known.graze else "agrees"
    return Verdict(label, known.graze or exact.reason, compared, count, error, worst)
