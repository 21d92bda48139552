"""Lists of events of the exact motion and of jaxcam that can be compared."""

import numpy as np

from ._switching_exact import CLOSES, CROSSES, Event, HITS, OPENS


# impacts this close to the end of their sequence are not compared
LATE = 1e-3
# events closer to each other than this are simultaneous
_SAME = 1e-10
_KINDS = "crosses", "begins sliding", "leaves", "impact", "contact", "release"


def listed(events: list[Event]) -> list[Event]:
    """The events that both programs list, with simultaneous events in the same order.

    Events at the start and the last impacts before a constraint closes are omitted.
    """
    closed = [(e.time, e.which) for e in events if e.kind == CLOSES]
    found = []
    for e in events:
        ends = [t - e.time for t, k in closed if k == e.which and e.kind == HITS]
        if e.time > _SAME and not any(-_SAME < left < LATE for left in ends):
            found.append(e)
    groups: list[list[Event]] = []
    for e in found:
        if groups and e.time - groups[-1][-1].time < _SAME:
            groups[-1].append(e)
        else:
            groups.append([e])
    return [e for group in groups for e in sorted(group, key=lambda e: e[1:3])]


def events_of(run) -> list[Event]:
    """The events of a run of jaxcam, without crossings by the jump at an impact."""
    hits, rests, switches = run.impacts, run.contacts, run.switches
    found = [
        Event(float(t), HITS, int(k), np.asarray(x), float(v))
        for t, k, x, v in zip(
            hits.time, hits.constraint, hits.after, hits.speed_before, strict=True
        )
    ]
    jumps = np.array([e.time for e in found])
    for t, kind, k, x in zip(
        switches.time, switches.kind, switches.surface, switches.after, strict=True
    ):
        jumped = np.min(np.abs(jumps - float(t)), initial=1.0) < _SAME
        if int(kind) != CROSSES or not jumped:
            found.append(Event(float(t), int(kind), int(k), np.asarray(x)))
    for start, stop, k, free in zip(
        rests.start, rests.end, rests.constraint, rests.released, strict=True
    ):
        found.append(Event(float(start), CLOSES, int(k), np.zeros(0)))
        if free:
            at = np.asarray(run.at(np.asarray([stop])))[0]
            found.append(Event(float(stop), OPENS, int(k), at))
    return sorted(found, key=lambda e: e.time)


def distance(one, other) -> float:
    """Largest difference of two states, relative to their size if it is above one."""
    if len(one) != len(other):
        # the state at the beginning of contact is not compared
        return 0.0
    size = max(1.0, float(np.max(np.abs(one), initial=0.0)))
    return float(np.max(np.abs(one - other), initial=0.0)) / size


def differ(one: Event, other: Event) -> float:
    """The difference of two events of the same kind: that of their times or that of
    their states, whichever is larger.
    """
    return max(abs(one.time - other.time), distance(one.state, other.state))


def described(events: list[Event]) -> str:
    """The first event in words, or `none`."""
    if not events:
        return "none"
    e = events[0]
    return f"{_KINDS[e.kind]} {e.which} at {e.time:.12g}"
