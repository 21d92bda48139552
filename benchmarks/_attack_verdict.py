"""Decide whether jaxcam's run of a problem agrees with the reference motion.

The reference motion is computed three times: once unchanged, and twice with the initial
state and time shifted by about 1e-8. The differences between the three give the
permitted error of a run. The comparison ends where the events of the three differ
(grazing) or the shift has grown beyond 1e-5; neither is an error of the run. Damping
may reduce the shift before it grows again, but an error made in between grows in full.
That error is assumed to be 1e-8 (about a hundred steps at the default tolerance) times
the growth since the smallest difference so far.
"""

import dataclasses
from typing import NamedTuple

import numpy as np

from jaxcam.hybrid import RESULTS

from ._attack_events import Events, listed, Mismatch, pairs
from ._attack_run import depths, Run, SAMPLES, simulated
from ._attack_systems import gaps_of, Problem, settled
from ._attack_truth import motion, Truth


# shift of the start, in units of the problem, and error made during the run
_MOVED, _ON_THE_WAY = 1e-8, 1e-8
# differences of two runs below this are meaningless
_ROUNDING = 1e-12
# error that is always permitted, and permitted ratio to the effect of the shift
_FLOOR, _MARGIN = 1e-7, 10.0
# growth of the shift beyond which nothing is compared
_LOST = 1e-5
# states this close in time to an impact are not compared
_NEAR = 1e-3
# permitted penetration and energy increase, relative to the size of the motion
_THROUGH, _RISE = 1e-9, 1e-8
# the one failure that docs/limits.md permits for a valid system
_DOCUMENTED = RESULTS[RESULTS.together]
# impacts accumulate if each of two gaps has impacts at `_TIMES` different times, or
# `_HITS` impacts in all, within `_NEAR` of the end of the run; impacts after the
# completion of chatter are not listed
_TIMES, _HITS = 3, 20


class Verdict(NamedTuple):
    """The result of one problem."""

    # acceptable: "agrees", "grazes", and "refuses" as documented in docs/limits.md; not
    # acceptable: "DISAGREES" and "MISBLAMES"
    label: str
    what: str
    # fraction of the span that was compared, and largest ratio of error to permitted
    # error
    compared: float
    worst: float


class Known(NamedTuple):
    """The reference motion, the end of the comparison, and the permitted errors."""

    truth: Truth
    end: float
    # times, and the permitted error of a run from each time on
    times: np.ndarray
    allowed: np.ndarray

    def room(self, t: float) -> float:
        """The permitted error of a run at a time."""
        return float(self.allowed[np.searchsorted(self.times, t, side="right") - 1])


def know(problem: Problem) -> Known:
    """Compute the reference motion, and the time up to which it is known."""
    truth = motion(problem, problem.state, 0.0, problem.span)
    if not truth.pieces:
        return Known(truth, 0.0, np.zeros(1), np.array([_FLOOR]))
    rng = np.random.default_rng(problem.state.size)
    samples = _clear(np.linspace(0, truth.end, SAMPLES + 1)[1:], truth)
    states = truth.at(samples)
    end, found, apart = truth.end, [(0.0, 0.0)], np.zeros(len(samples))
    for sign in (1, -1):
        shift = sign * (_MOVED + 4e-16 * abs(problem.begin) / problem.time)
        start = _moved(problem, shift, rng)
        other = motion(problem, start, shift, problem.span + shift, 1e-11)
        end = min(end, other.end - shift)
        one, two = _events(truth), _events(other, shift)
        for kind in ("impacts", "contacts"):
            mine, theirs = _rows(one, two, kind), _rows(two, one, kind)
            matched, mismatch = pairs(mine, theirs, end, lambda t: 1e-4)
            if mismatch:
                end = min(end, mismatch.time - 1e-4)
            for a, b in matched:
                known = np.isfinite(a) & np.isfinite(b)
                found.append((a[0], np.max(np.abs(a[known] - b[known]))))
        late = samples <= end - 1e-4
        error = _distance(states[late], other.at(samples[late] + shift))
        apart[: len(error)] = np.maximum(apart[: len(error)], error)
    some = samples <= end - 1e-4
    samples, apart = samples[some], apart[some]
    least = np.minimum.accumulate(apart) + _ROUNDING
    found += [
        *zip(samples, np.maximum(apart, _ON_THE_WAY * apart / least), strict=True)
    ]
    found = np.array(sorted(found))
    growth = np.maximum.accumulate(found[:, 1])
    lost = np.flatnonzero(growth > _LOST)
    if len(lost):
        end = min(end, found[max(lost[0] - 1, 0), 0])
    return Known(truth, end, found[:, 0], _FLOOR + _MARGIN * growth)


def judge(problem: Problem, known: Known, **options) -> Verdict:
    """Compare a run of jaxcam with the true motion."""
    try:
        run = simulated(problem, **options)
    except ValueError as error:
        # an error is wrong here: the random system and its initial state are valid
        return Verdict("MISBLAMES", f"at the start: {error}", 0.0, 0.0)
    except Exception as error:
        said = f"{type(error).__name__}: {error}".splitlines()[0]
        return Verdict("DISAGREES", f"raised {said}", 0.0, np.inf)
    limit, label = known.end, "agrees"
    end = min(limit, run.end)
    broken = _invariant(problem, run)
    if broken:
        return Verdict("DISAGREES", broken, end / problem.span, np.inf)
    mismatch = _differ(known, run, end)
    if mismatch and not _grazes(known, run, mismatch):
        said = f"t = {mismatch.time:.9g}: {mismatch.what}"
        return Verdict("DISAGREES", said, mismatch.time / problem.span, np.inf)
    if mismatch:
        # beyond an impact that may or may not occur, there is nothing to compare
        limit = end = min(end, max(mismatch.time, 0.0))
        label = "grazes"
    compared = end / problem.span
    inside = (run.times <= end - _NEAR) & (run.times > 0)
    times, states = run.times[inside], run.states[inside]
    clear = np.isin(times, _clear(times, known.truth, run))
    times, states = times[clear], states[clear]
    error = _distance(known.truth.at(times), states) if len(times) else np.zeros(0)
    ratio = error / np.array([known.room(t) for t in times])
    worst = float(np.max(ratio, initial=0.0))
    if not worst <= 1:
        i = int(np.argmax(~(ratio <= 1)))
        said = f"t = {times[i]:.9g}: state wrong by {error[i]:.1e}"
        return Verdict(
            "DISAGREES", f"{said}, {ratio[i]:.1e} of allowed", compared, worst
        )
    if run.result:
        said = "beyond what is known" if run.end >= limit else _situation(known, run)
        due = run.result == _DOCUMENTED and _accumulates(run)
        label = "refuses" if due else "MISBLAMES"
        return Verdict(label, f"{said}: {run.result}", compared, worst)
    return Verdict(label, "", compared, worst)


def _moved(problem, shift, rng) -> np.ndarray:
    """The initial state shifted by about 1e-8, on the same surfaces."""
    state = problem.state + _MOVED * rng.normal(size=problem.state.size)
    closed = np.flatnonzero(gaps_of(problem, 0.0, problem.state) < 1e-9)
    if problem.resting:
        return settled(problem, state, problem.resting, shift)
    if closed.size:
        back = settled(problem, state, tuple(closed), shift)
        d = problem.mass.size
        state = np.concatenate([back[:d], state[d:]])
    return state


def _events(truth: Truth, shift: float = 0.0) -> Events:
    impacts = np.array([(i.time - shift, i.constraint) for i in truth.impacts])
    contacts = np.array(sorted((a, b, k) for a, b, k in truth.contacts))
    contacts = contacts.reshape(-1, 3) - [shift, shift, 0]
    sequences = [(a - shift, b - shift) for a, b, _ in truth.sequences]
    return Events(impacts.reshape(-1, 2), contacts, sequences)


def _rows(one: Events, other: Events, kind: str) -> np.ndarray:
    return listed(one, other, 1e-7) if kind == "impacts" else one.contacts


def _distance(one, other) -> np.ndarray:
    """Largest difference of each state, relative to one plus its magnitude."""
    size = 1 + np.max(np.abs(one), axis=1, initial=0.0)
    return np.max(np.abs(one - other), axis=1, initial=0.0) / size


def _clear(times, truth: Truth, run: Run | None = None) -> np.ndarray:
    """The times that are neither at an impact nor within a sequence of impacts."""
    keep = np.ones(len(times), bool)
    spans = [(i.time, i.time) for i in truth.impacts]
    spans += [(a, b) for a, b, _ in truth.sequences]
    spans += run.events.sequences if run else []
    for first, last in spans:
        keep &= (times < first - _NEAR) | (times > last + _NEAR)
    return times[keep]


def _differ(known: Known, run: Run, end: float) -> Mismatch | None:
    """The first event that the two runs do not share."""
    true = _events(known.truth)
    found = []
    for kind in ("impacts", "contacts"):
        mine, theirs = _rows(true, run.events, kind), _rows(run.events, true, kind)
        matched, mismatch = pairs(mine, theirs, end, lambda t: 10 * known.room(t))
        found += [mismatch] if mismatch else []
        for a, b in matched:
            ends = min(a[1], b[1])
            if kind == "contacts" and ends < end - 10 * known.room(min(ends, end)):
                if not abs(a[1] - b[1]) <= 10 * known.room(ends):
                    said = f"contact ends at {b[1]:.9g}, not {a[1]:.9g}"
                    found.append(Mismatch(float(ends), said))
    return min(found, default=None)


def _grazes(known: Known, run: Run, mismatch: Mismatch) -> bool:
    """Whether an impact found in only one run is grazing to within the tolerance."""
    room = known.room(min(mismatch.time, known.end))
    hits = [i for i in known.truth.impacts if abs(i.time - mismatch.time) <= 1e-6]
    speeds, pulls = ([i[k] for i in hits] for k in (2, 3))
    near = np.abs(run.events.impacts[:, 0] - mismatch.time) <= 1e-6
    there = np.concatenate(
        [depths(np.array(speeds), np.array(pulls)), run.depths[near]]
    )
    return bool(there.size) and np.max(there) <= room


def _accumulates(run: Run) -> bool:
    """Whether impacts at two or more gaps accumulate before the end of a run.

    A few simultaneous impacts, as in a corner, are not an accumulation.
    """
    late = run.events.impacts[run.events.impacts[:, 0] >= run.end - _NEAR]
    crowded = 0
    for k in np.unique(late[:, 1]):
        times = late[late[:, 1] == k, 0]
        crowded += len(np.unique(times)) >= _TIMES or len(times) >= _HITS
    return crowded > 1


def _invariant(problem: Problem, run: Run) -> str:
    """A condition that every motion must satisfy but this one violates, or an empty
    string.
    """
    if not np.all(np.isfinite(run.states)):
        return "a state is not finite"
    d = problem.mass.size
    size = 1 + np.max(np.abs(run.states[:, :d]))
    gaps = np.array(
        [gaps_of(problem, t, y) for t, y in zip(run.times, run.states, strict=True)]
    )
    # a late time is rounded, and so is the position of a wall
    late = 4e-16 * abs(problem.begin) / problem.time
    through = (
        np.min(gaps)
        + _THROUGH * size
        + late * np.max(np.abs(problem.wall * problem.wall_frequency))
    )
    if through < 0:
        where = run.times[np.argmin(np.min(gaps, axis=1))]
        return f"t = {where:.9g}: a gap of {np.min(gaps):.1e}"
    if problem.conservative:
        order = np.argsort(run.times, kind="stable")
        energy = _energy(problem, run.states[order])
        rise = np.diff(energy) - _RISE * (1 + np.max(np.abs(energy)))
        if np.max(rise, initial=0.0) > 0:
            i = int(np.argmax(rise))
            return f"t = {run.times[order][i + 1]:.9g}: energy rises by {rise[i]:.1e}"
    return ""


def _energy(problem: Problem, states) -> np.ndarray:
    d = problem.mass.size
    q, v = states[:, :d], states[:, d:]
    spring = np.einsum("ki,ij,kj->k", q, problem.stiffness, q) / 2
    kinetic = v**2 @ problem.mass / 2
    return kinetic + spring + q**4 @ problem.cubic / 4 - q @ problem.weight


def _situation(known: Known, run: Run) -> str:
    """The event of the reference motion at the time where the run stopped."""
    t, truth, near = run.end, known.truth, 1e-3
    for first, last, which in truth.sequences:
        if first - near <= t <= last + near:
            together = "several gaps together" if len(which) > 1 else "one gap"
            return f"end of chatter, {together}"
    if any(abs(end - t) <= near for _, end, _ in truth.contacts):
        return "release"
    if any(abs(i.time - t) <= near for i in truth.impacts):
        return "impact"
    return "nothing in particular"


def plain(problem: Problem, **changes) -> Problem:
    """The same problem in unit scales, starting at time zero."""
    return dataclasses.replace(problem.in_plain_units(), **changes)
