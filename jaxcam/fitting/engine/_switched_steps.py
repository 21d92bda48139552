"""Integrate a switched system in steps that end at its events.

The events of a piece are located first, without derivatives. With the lengths of the
parts between them known, the motion is integrated once more, and each event moves by
the implicit function theorem. The derivatives therefore contain the saltation matrices
of all crossings, of the beginning of sliding and of its end.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...hybrid.runge_kutta import array_step, RK4
from ...hybrid.surface import switching_distances
from ._constant import constant
from ._event_search import advancing, begun, Located, located, Part, Steps
from ._model import DriveState, filtered_channels, Model
from ._modes import distances_along, first_mode, Mode, state_after, surfaces_in


# Maximum number of events located in a piece, which is at most half an oscillation
EVENTS = 8


class Flight(NamedTuple):
    """The motion of a piece with substeps, without derivatives."""

    states: Float[Array, "n1 s"]
    """States at the ends of all steps, shape `(n + 1, s)`."""
    rates: Float[Array, "n1 s"]
    """Their rates, shape `(n + 1, s)`."""
    located: Located | None = None
    """The events of a switched system."""


def switched_flight(
    model: Model,
    state,
    start,
    step,
    drive: DriveState,
    substeps,
    mode: Mode | None = None,
    events: int = EVENTS,
    discrete=None,
) -> Flight:
    """Locate the events of a piece, without derivatives.

    **Arguments:** as for `fly`, the `mode` at the start (default: that of a motion that
    starts there in the `discrete` state), and the maximum number of events.
    """
    given = constant((model, state, start, step, drive, mode))
    model, state, start, step, drive, mode = given
    steps, mode = _steps(model, state, start, step, drive, mode, events, discrete)
    found = located(steps, state, mode, substeps)
    first = _at_steps(found.parts, steps)

    def rate(number, x, mode):
        return steps.field(number, mode)(steps.begin(number), x)

    rates = jax.vmap(rate)(jnp.arange(steps.count), first.state, first.mode)
    last = _last_rate(steps, found, found.end)
    return Flight(
        jnp.concatenate([first.state, found.end[None]]),
        jnp.concatenate([rates, last[None]]),
        found,
    )


def states_and_sides(model: Model, state, start, step, drive: DriveState, discrete):
    """Return the states at the beginnings of all steps, shape `(n, s)`, and whether the
    motion is then on the negative side of each surface, shape `(n, k)`, without
    derivatives.

    **Arguments:** as for `switched_flight`.
    """
    given = model, state, start, step, drive
    flight = switched_flight(*given, 1, discrete=discrete)
    assert flight.located is not None
    steps, _ = _steps(*given, flight.located.mode, EVENTS)
    first = _at_steps(flight.located.parts, steps)
    return first.state, first.mode.negative


def switched_nodes(
    model: Model, state, start, step, drive: DriveState, flight: Flight
) -> tuple[Float[Array, "n1 s"], Float[Array, "n1 s"]]:
    """Return the states at the ends of all steps, and their rates, with derivatives.

    **Arguments:** as for `fly`, and the motion of the piece with substeps.
    """
    found = flight.located
    assert found is not None
    steps, _ = _steps(model, state, start, step, drive, found.mode, EVENTS)
    states, rates, end = _integrated(steps, state, found.parts)
    states = jnp.concatenate([states, end[None]])
    last = _last_rate(steps, found, states[-1])
    return states, jnp.concatenate([rates, last[None]])


def switched_steps(
    model: Model, state, start, step, drive: DriveState, mode: Mode, events: int
) -> tuple[Float[Array, " s"], Float[Array, " s"], Located]:
    """Return the state at the end of a motion without substeps and the rate at its
    start, with derivatives, and its events.

    **Arguments:** as for `switched_flight`.
    """
    given = model, state, start, step, drive
    flight = switched_flight(*given, 1, mode, events)
    states, rates = switched_nodes(*given, flight)
    assert flight.located is not None
    return states[-1], rates[0], flight.located


def _last_rate(steps: Steps, found: Located, end):
    field = steps.field(steps.count - 1, found.mode)
    return field(steps.begin(steps.count), end)


def switched_end(
    model: Model, state, start, step, drive: DriveState, substeps, discrete=None
):
    """Return the state at the end, `(s,)`, without derivatives; `substeps` may be
    traced.
    """
    return _ended(model, state, start, step, drive, substeps, discrete, EVENTS).state


def has_more_events(
    model: Model, state, start, step, drive: DriveState, substeps, discrete=None
):
    """Return whether a piece has more events than are located; `substeps` may be
    traced.
    """
    most = EVENTS + 1
    found = _ended(model, state, start, step, drive, substeps, discrete, most)
    return found.events > EVENTS


def _ended(
    model: Model, state, start, step, drive: DriveState, substeps, discrete, events
):
    """Return the end of a piece, without derivatives; at most `events` events are
    located.
    """
    given = model, state, start, step, drive
    steps, mode = _steps(*given, None, events, discrete)
    advance = advancing(steps, substeps)
    return jax.lax.while_loop(
        lambda one: one.place < steps.count * substeps,
        lambda one: advance(one)[0],
        begun(steps, state, mode),
    )


def _steps(
    model: Model, state, start, step, drive: DriveState, mode, events, discrete=None
):
    size = state.shape[0] - len(filtered_channels(model))
    first = DriveState(*(part[0] for part in drive))
    system = model.during(start + step / 2, first)(start)
    known = surfaces_in(system, start, state[:size])
    if mode is None:
        duration = step * jnp.asarray(drive.angle.shape[0], dtype=float)
        mode = first_mode(known, system, start, state[:size], duration, discrete)
    return Steps(model, start, step, drive, known, size, events), mode


def _at_steps(parts: Part, steps: Steps) -> Part:
    """Return the part with which each step begins."""
    first = jnp.searchsorted(parts.number, jnp.arange(steps.count))
    return jax.tree.map(lambda one: one[first], parts)


def _integrated(steps: Steps, state, parts: Part):
    """Return the state and the rate at the beginning of each step, and the state at the
    end, with derivatives.

    An event moves in time by the implicit function theorem. The change of its time is
    zero and only has derivatives, so the rates before and after need none.
    """
    size, still = steps.size, constant(steps)

    def advance(carried, part: Part):
        x, moved_by = carried
        number = jnp.minimum(part.number, steps.count - 1)
        t = steps.begin(number) + part.offset
        field = steps.field(number, part.mode)
        there, _, rate = array_step(RK4, field, t, x, part.length)
        t, fixed = t + part.length, jax.lax.stop_gradient(there)
        before = still.field(number, part.mode)(t, fixed)
        system = steps.in_mode(number, part.mode)(t)
        distances = switching_distances(system, t, there[:size])
        _, slopes = distances_along(constant(system), t, fixed[:size], before[:size])
        distance = jnp.sum(jnp.where(part.ends, distances, 0.0))
        slope = jnp.sum(jnp.where(part.ends, slopes, 0.0))
        # if the motion hardly approaches the surface, do not differentiate the event
        # time
        slope = jnp.where(slope < 0, slope, -jnp.inf)
        later = -(distance - jax.lax.stop_gradient(distance)) / slope
        event, at_once = jnp.any(part.ends), part.length == 0
        # a transition whose guard is far below zero takes place at the beginning; one
        # that only just is moves as if the piece had begun earlier
        begins = at_once & (part.number == 0) & (part.offset == 0)
        far = distance < jnp.minimum(slope, 0.0) * steps.step
        later = jnp.where(begins & far, 0.0, later)
        # an event caused by another event shifts with it
        later = jnp.where(at_once & (moved_by[1] > 0), moved_by[0], later)
        kept = jnp.where(at_once, moved_by, 0.0)
        moved_by = jnp.where(event, jnp.stack([later, 1.0]), kept)
        moved, at = there + later * before, t + later
        system = steps.in_mode(number, part.mode)(at)
        landed = state_after(system, at, moved[:size], part.ends)
        moved = moved.at[:size].set(landed)
        after = still.field(number, part.after)(t, jax.lax.stop_gradient(moved))
        moved = moved - later * after
        return (jnp.where(event, moved, there), moved_by), (x, rate)

    carried = state, jnp.zeros(2)
    (end, _), (states, rates) = jax.lax.scan(advance, carried, parts)
    first = jnp.searchsorted(parts.number, jnp.arange(steps.count))
    return states[first], rates[first], end
