"""Detect changes of the sequence of events along a branch, and name them."""

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem, Settings, simulate
from variational.orbits import Event, events_in_time

from .._parameter import as_jax
from ..problem import Monitor


CHANGE = "change of events"
"""Kind of a change that has no name of its own."""

# Largest difference between the half periods of a symmetric orbit, as a fraction of the
# period: just beyond a grazing, the times of events vary as the square root of the
# errors
_SYMMETRIC = 1e-4

# Events at a constraint and at a surface coincide if the time between them is between
# these fractions of the longest interval between events; below, they are one event
_AT_ONCE, _CLOSE = 1e-12, 1e-3

_MODE = ("contacts", "sides", "sliding")
_COUNTED = ("impacts", "contacts", "crossings", "slides", "leaves")
_ORDER = "order of events"


def monitors_of_events() -> dict[str, Monitor]:
    """Return two monitors for each kind of event, and one for each part of the mode.

    Of the two, the first changes sign if one event is added or removed, the second if
    two are. The mode at the start of the period changes where an event passes through
    the start, and the order of events where two of them occur at the same time.
    """
    names = [name for one in _COUNTED for name in (one, f"pairs of {one}")]
    names += [f"{part} at the start" for part in _MODE] + [_ORDER]
    return {name: Monitor(CHANGE, bracket=True, corner=True) for name in names}


def values_of_events(arrival: Any) -> dict[str, Float[Array, ""]]:
    """Return the value of each monitor, +1 or -1, from the `Arrival` of an orbit."""
    found = {}
    m = arrival.contact.shape[0]
    k = (arrival.start.shape[0] - m) // 2
    for part, flags in zip(_MODE, jnp.split(arrival.start, [m, m + k]), strict=True):
        found[f"{part} at the start"] = jnp.prod(jnp.where(flags, -1.0, 1.0))
    for name in _COUNTED:
        number = getattr(arrival.events, name)
        found[name] = 1.0 - 2.0 * jnp.mod(number, 2.0)
        found[f"pairs of {name}"] = 1.0 - 2.0 * jnp.mod(jnp.floor(number / 2), 2.0)
    found[_ORDER] = arrival.events.order
    return found


def change_between(problem: Any, before, after) -> str | None:
    """Return the name of the change of events between two orbits of a `SingleShooting`,
    each given by its unknowns and parameters.
    """

    def events(u, parameters):
        u, system = jnp.asarray(u), as_jax(parameters)
        start, end = problem.times(u, system)
        given = system, problem.start(u, system), start, end, problem.settings
        return events_of(*given), float(end - start)

    (first, length), (second, _) = events(*before), events(*after)
    return name_of_change(*within_symmetry(first, second, length), length)


def events_of(
    system: HybridSystem, state, start, end, settings: Settings
) -> list[tuple[float, Event]]:
    """Return the events of one period of a motion with their times (s); an empty list
    if the simulation fails.

    The period begins in the longest interval without events, so that an event at
    `start` occurs once.
    """
    start, end = float(start), float(end)
    run = simulate(system, state, start, 2 * end - start, settings=settings)
    if not run.successful:
        return []
    found = events_in_time(run.impacts, run.contacts, run.switches)
    times = np.array([time for time, _ in found if time <= end] + [end])
    longest = int(np.argmax(np.diff(times, prepend=start)))
    begin = times[longest] - np.diff(times, prepend=start)[longest] / 2
    return [one for one in found if begin <= one[0] < begin + end - start]


def within_symmetry(
    before: list[tuple[float, Event]],
    after: list[tuple[float, Event]],
    period: float,
) -> tuple[list[tuple[float, Event]], list[tuple[float, Event]]]:
    """Return the events of half a period if, in both orbits, those of the other half
    repeat them, and all events otherwise.

    On a branch of symmetric orbits, every change occurs twice at the same point.
    """
    halves = [_half(events, period) for events in (before, after)]
    if any(half is None for half in halves):
        return before, after
    return halves[0], halves[1]  # pyright: ignore


def _half(events: list[tuple[float, Event]], period: float):
    """Return the first half of the events if they repeat after half a period, or None.

    The constraints and surfaces need not be the same: a symmetry may exchange them.
    """
    number, odd = divmod(len(events), 2)
    if odd or not number:
        return None
    for (time, event), (later, other) in zip(
        events[:number], events[number:], strict=True
    ):
        shift = later - time - period / 2
        if event.kind != other.kind or abs(shift) > _SYMMETRIC * period:
            return None
    return events[:number]


def name_of_change(
    before: list[tuple[float, Event]],
    after: list[tuple[float, Event]],
    period: float = math.inf,
) -> str | None:
    """Return the name of the bifurcation between two sequences of events, or None if
    they belong to the same orbit, started at another phase.

    - `"grazing"`: the orbit touches a constraint or a switching surface, which adds an
      impact or two crossings.
    - `"grazing-sliding"`: it touches a surface, and slides there.
    - `"crossing-sliding"`: a crossing of a surface becomes sliding along it.
    - `"switching-sliding"`: it crosses a surface before it slides there.
    - `"adding-sliding"`: it leaves the surface for a moment during sliding.
    - `"corner collision"`: events at different constraints or surfaces exchange their
      order, or an event at a surface appears or disappears at an impact; the orbit
      passes through the intersection of both.

    (M. di Bernardo, P. Kowalczyk, A. Nordmark, Bifurcations of dynamical systems with
    sliding, Physica D 170 (2002))
    """
    first, second = ([event for _, event in part] for part in (before, after))
    if _rotated(first, second):
        return None
    # the longer sequence is that of the orbit with the additional events
    if len(first) > len(second):
        before, after = after, before
        first, second = second, first
    added = Counter(event.kind for event in second)
    added.subtract(event.kind for event in first)
    change = {kind: number for kind, number in added.items() if number}
    if change in ({"impact": 1}, {"cross": 2}):
        return "grazing"
    if change == {"cross": 1}:
        return "switching-sliding"
    if change == {"slide": 1, "leave": 1, "cross": -1}:
        return "crossing-sliding"
    if not change and _exchanged(first, second):
        return "corner collision"
    if change == {"slide": 1, "leave": 1}:
        return "grazing-sliding" if _briefest(after) == "slide" else "adding-sliding"
    if any(_coincide(part, change, period) for part in (before, after)):
        return "corner collision"
    return CHANGE


def _rotated(first: list[Event], second: list[Event]) -> bool:
    """Return whether two periodic sequences are equal except for where they start."""
    if len(first) != len(second):
        return False
    turns = range(max(1, len(first)))
    return any(first[k:] + first[:k] == second for k in turns)


def _exchanged(first: list[Event], second: list[Event]) -> bool:
    """Return whether two periodic sequences differ by the order of two consecutive
    events at different constraints or surfaces.
    """
    number = len(first)
    for k in range(number):
        other, after = first[k], first[(k + 1) % number]
        if _place(other) == _place(after):
            continue
        swapped = list(first)
        swapped[k], swapped[(k + 1) % number] = after, other
        if _rotated(swapped, second):
            return True
    return False


def _coincide(
    events: list[tuple[float, Event]], change: Mapping[str, int], period: float
) -> bool:
    """Return whether an event at a surface, of a kind whose number changes, is very
    close to an event at a constraint.

    An impact that moves the state across a surface is a single event. The time between
    events is measured by the longest interval, or by the part of the period after them.
    """
    pairs = list(zip(events[:-1], events[1:], strict=True))
    gaps = [later - time for (time, _), (later, _) in pairs]
    rest = period - sum(gaps)
    longest = max([*gaps, rest if math.isfinite(rest) else 0.0])
    return any(
        _AT_ONCE * longest < gap < _CLOSE * longest
        and _place(event)[0] != _place(other)[0]
        and {event.kind, other.kind} & set(change)
        for ((_, event), (_, other)), gap in zip(pairs, gaps, strict=True)
    )


def _place(event: Event) -> tuple[bool, int]:
    """Return where an event occurs: at a surface or at a constraint, and which."""
    return event.kind in ("cross", "slide", "leave"), event.constraint


def _briefest(events: list[tuple[float, Event]]) -> str:
    """Return which of the events `"slide"` and `"leave"` begins the shortest interval
    between two such events.
    """
    pairs = [
        (later - time, event.kind)
        for (time, event), (later, other) in zip(events[:-1], events[1:], strict=True)
        if {event.kind, other.kind} == {"slide", "leave"}
    ]
    return min(pairs, default=(0.0, "slide"))[1]
