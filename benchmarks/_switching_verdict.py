"""Compare a run of jaxcam with the exact motion.

The exact motion is computed three times: once unchanged, and twice with changes of
about 1e-8 at the start and after each event. The largest difference so far, over 1e-8,
is the growth of errors; a run may differ by 1e-9 times this growth (at least one). The
comparison ends at the first event that the three motions do not share (grazing), where
the growth exceeds 1e4, and where impacts accumulate on a body with friction normal to a
wall, which jaxcam does not sum (docs/switching.md).
"""

from typing import NamedTuple

import numpy as np

import jaxcam
from jaxcam.hybrid import Settings

from ._switching_draw import Problem
from ._switching_exact import CLOSES, CROSSES, Event, Exact, HITS, motion, Noise, OPENS, Programs
from ._switching_invariants import broken


# permitted error of times and states, times the growth of errors
ALLOWED = 1e-9
SETTINGS = Settings(tolerance=1e-12)
_NOISE, _LOST = 1e-8, 1e4
# impacts this close to the end of their sequence are not compared
_LATE = 1e-3
# events closer to each other than this are simultaneous
_SAME = 1e-10


class Verdict(NamedTuple):
    """The result of one problem."""

    # "agrees", "grazes" or "DISAGREES"
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
    # whether a graze or growth ends the comparison
    ambiguous: bool


def know(problem: Problem) -> Known:
    """The exact motion of a problem, and up to where it is known."""
    programs = Programs(problem.linear)
    why=''
    exact = motion(programs, problem.state, problem.span, ends=problem.ends)
    events = listed(exact.events)
    end, growth, ambiguous = exact.end, np.ones(len(events) + 1), False
    if exact.reason:
        end -= _LATE
    for sign in (1, -1):
        noise = Noise(np.random.default_rng(0), sign * _NOISE)
        other = motion(programs, problem.state, problem.span, noise, problem.ends)
        others = listed(other.events)
        for i in range(max(len(events), len(others))):
            pair = events[i : i + 1] + others[i : i + 1]
            if len(pair) < 2 or pair[0][1:3] != pair[1][1:3]:
                first = min(e.time for e in pair)
                if first < end:
                    end, ambiguous = first - 1e-6, True
                    why = f"grazes: {_said(pair[:1])}, {_said(pair[1:])}"
                break
            one, two = pair
            apart = max(abs(one.time - two.time), _distance(one.state, two.state))
            growth[i] = max(growth[i], apart / _NOISE)
        if len(events) == len(others) and other.end == exact.end:
            growth[-1] = max(growth[-1], _distance(exact.final, other.final) / _NOISE)
    growth = np.maximum.accumulate(growth)
    lost = [e.time for e, g in zip(events, growth, strict=False) if g > _LOST]
    if lost and lost[0] <= end:
        end, ambiguous = lost[0] - 1e-6, True
        why = "grows"
    return Known(exact, events, end, growth, ambiguous)


def listed(events: list[Event]) -> list[Event]:
    """The events that both programs list: not those at the start, and not the last
    impacts before a constraint closes.
    """
    closed = [(e.time, e.which) for e in events if e.kind == CLOSES]
    found = [
        e
        for e in events
        if e.time > _SAME
        and not (
            e.kind == HITS
            and any(-_SAME < t - e.time < _LATE for t, k in closed if k == e.which)
        )
    ]
    # simultaneous events may come in any order
    for i in range(1, len(found)):
        while i and found[i].time - found[i - 1].time < _SAME and found[i][1:3] < found[i - 1][1:3]:
            found[i - 1], found[i], i = found[i], found[i - 1], i - 1
    return found


def judge(problem: Problem, known: Known, settings: Settings = SETTINGS) -> Verdict:
    """Compare a run of jaxcam with what is known."""
    exact, end = known.exact, known.end
    run = jaxcam.simulate(
        problem.system, problem.state, 0.0, problem.span, settings=settings
    )
    compared, count = max(end, 0.0) / problem.span, 0
    label = "grazes" if known.ambiguous else "agrees"
    stopped = float(np.asarray(run.steps.time)[int(run.steps.count) - 1])

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
    for count, growth in enumerate(known.growth[: max(len(mine), len(theirs))]):
        pair = mine[count : count + 1], theirs[count : count + 1]
        if not all(pair) or pair[0][0][1:3] != pair[1][0][1:3]:
            return wrong(f"events: exact {_said(pair[0])}, jaxcam {_said(pair[1])}")
        one, two = pair[0][0], pair[1][0]
        late = abs(one.time - two.time)
        off = late if one.kind == CLOSES else max(late, _distance(one.state, two.state))
        error, worst = max(error, late), max(worst, off / (ALLOWED * growth))
        if worst > 1:
            return wrong(f"{_said([one])}: off by {off:.1e}, growth {growth:.1e}")
    count = len(mine)
    if end == problem.span:
        off = _distance(exact.final, np.asarray(run.final))
        worst = max(worst, off / (ALLOWED * known.growth[-1]))
        if worst > 1:
            return wrong(f"final state off by {off:.1e}, growth {known.growth[-1]:.1e}")
    return Verdict(label, exact.reason, compared, count, error, worst)


def events_of(run) -> list[Event]:
    """The events of a run of jaxcam; crossings by the jump of an impact are none."""
    hits, rests, switches = run.impacts, run.contacts, run.switches
    found = [
        Event(float(t), HITS, int(k), x, float(v))
        for t, k, x, v in zip(
            hits.time,
            hits.constraint,
            np.asarray(hits.after),
            hits.speed_before,
            strict=True,
        )
    ]
    jumps = np.array([e.time for e in found])
    for t, kind, k, x in zip(
        np.asarray(switches.time),
        np.asarray(switches.kind),
        np.asarray(switches.surface),
        np.asarray(switches.after),
        strict=True,
    ):
        if kind != CROSSES or np.min(np.abs(jumps - t), initial=1.0) > _SAME:
            found.append(Event(float(t), int(kind), int(k), x))
    for start, stop, k, free in zip(
        rests.start, rests.end, rests.constraint, rests.released, strict=True
    ):
        found.append(Event(float(start), CLOSES, int(k), np.zeros(0)))
        if free:
            at = np.asarray(run.at(np.asarray([stop])))[0]
            found.append(Event(float(stop), OPENS, int(k), at))
    return sorted(found, key=lambda e: e.time)


def _distance(one, other) -> float:
    """Largest difference of two states, relative to their size if it is above one."""
    if len(one) != len(other):
        return 0.0
    size = max(1.0, float(np.max(np.abs(one), initial=0.0)))
    return float(np.max(np.abs(one - other), initial=0.0)) / size


_KINDS = "crosses", "begins sliding", "leaves", "impact", "contact", "release"


def _said(events) -> str:
    if not events:
        return "none"
    e = events[0]
    return f"{_KINDS[e.kind]} {e.which} at {e.time:.12g}"
