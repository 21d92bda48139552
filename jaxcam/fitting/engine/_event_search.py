"""Locate the events of a piece of a switched system, without derivatives."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ...hybrid.runge_kutta import array_step, RK4
from ...hybrid.surface import switching_distances
from ._model import augmented_field, DriveState, Model
from ._modes import Mode, mode_after, state_after, Surfaces


# Maximum number of Runge-Kutta steps that locate an event: one to the end, one of
# length zero, and those of the Illinois method
_SEARCH = 10


# A guard counts as zero at the beginning of its mode if it is negative by less than
# this fraction of its rise within a piece
_ZERO = 0.2


class Part(NamedTuple):
    """A part of a step: up to an event or to the end of the step."""

    number: Int[Array, ""]
    """Index of the step."""
    offset: Float[Array, ""]
    """Time since the beginning of the step (s)."""
    length: Float[Array, ""]
    """Duration (s)."""
    state: Float[Array, " s"]
    """State at the beginning, shape `(s,)`."""
    mode: Mode
    """Mode of the motion."""
    ends: Bool[Array, " k"]
    """The surface whose event ends the part, if any."""
    after: Mode
    """Mode of the motion after the part."""


class Located(NamedTuple):
    """The parts of a piece between its events, and its end."""

    parts: Part
    """The parts; those that are not needed have no length."""
    end: Float[Array, " s"]
    """State at the end, shape `(s,)`."""
    mode: Mode
    """Mode at the end."""

    @property
    def events(self) -> Int[Array, ""]:
        """Return the number of events."""
        return jnp.sum(jnp.any(self.parts.ends, axis=-1))


class Steps(NamedTuple):
    """The steps of a piece."""

    model: Model
    start: Float[Array, ""]
    step: Float[Array, ""]
    drive: DriveState
    surfaces: Surfaces
    size: int
    """Number of components of the system's state, without those of sensor filters."""
    events: int
    """Number of events that are located."""

    @property
    def count(self) -> int:
        return self.drive.angle.shape[0]

    def begin(self, number):
        """Return the time at which a step begins."""
        return self.start + jnp.asarray(number, dtype=float) * self.step

    def in_mode(self, number, mode: Mode) -> Callable:
        """Return the system in one mode as a function of time, during a step."""
        here = DriveState(*(part[number] for part in self.drive))
        system_at = self.model.during(self.begin(number) + self.step / 2, here)
        return lambda t: self.surfaces.within(system_at(t), mode)

    def field(self, number, mode: Mode) -> Callable:
        """Return the vector field in one mode, sensor filters included."""
        system_at = self.in_mode(number, mode)
        return lambda t, x: augmented_field(self.model, system_at(t), t, x)


def located(steps: Steps, state, mode: Mode, substeps) -> Located:
    """Locate the events of a piece; its parts end there and at the ends of steps."""
    advance, count = advancing(steps, substeps), steps.count * substeps
    nothing = Part(
        jnp.asarray(steps.count),
        jnp.zeros_like(steps.step),
        jnp.zeros_like(steps.step),
        state,
        mode,
        jnp.zeros((steps.surfaces.number,), dtype=bool),
        mode,
    )
    room = steps.count + steps.events
    empty = jax.tree.map(lambda one: jnp.broadcast_to(one, (room, *one.shape)), nothing)

    def further(carried):
        place, begun, whole, number, parts = carried
        after, part = advance(place)
        first = jax.tree.map(lambda a, b: jnp.where(begun, a, b), whole, part)
        whole = first._replace(
            length=part.length + jnp.where(begun, whole.length, 0.0),
            ends=part.ends,
            after=part.after,
        )
        parts = jax.tree.map(lambda a, b: a.at[number].set(b), parts, whole)
        ended = jnp.any(part.ends) | (after.place % substeps == 0)
        return after, ~ended, whole, number + ended.astype(int), parts

    last, *_, used, parts = jax.lax.while_loop(
        lambda carried: carried[0].place < count,
        further,
        (begun(steps, state, mode), False, nothing, jnp.asarray(0), empty),
    )
    # the unused parts are empty and follow the last step
    other = jnp.arange(room)[:, None] >= used
    final = Mode(*(jnp.where(other, a, b) for a, b in zip(last.mode, parts.mode)))
    return Located(parts._replace(mode=final), last.state, last.mode)


class Place(NamedTuple):
    """Progress of the search for events."""

    place: Int[Array, ""]
    """Number of finished substeps."""
    passed: Float[Array, ""]
    """Time since the end of the last finished substep (s)."""
    state: Float[Array, " s"]
    mode: Mode
    events: Int[Array, ""]


def begun(steps: Steps, state, mode: Mode) -> Place:
    zero = jnp.zeros((), dtype=int)
    return Place(zero, jnp.zeros_like(steps.step), state, mode, zero)


def advancing(steps: Steps, substeps):
    """Return the function that advances to the next event or end of a substep."""
    short = steps.step / jnp.asarray(substeps, dtype=float)
    count = steps.count * substeps

    def advance(carried: Place):
        place, passed, x, mode, events = carried
        # a finished piece waits for the others of its batch
        inside = jnp.minimum(place, count - 1)
        number = inside // substeps
        within = jnp.asarray(inside - number * substeps, dtype=float)
        offset = within * short + passed
        left = short - passed
        t = steps.begin(number) + offset
        wanted = events < steps.events
        found = _first_event(steps, number, t, x, mode, left, wanted)
        part = Part(number, offset, found.length, x, mode, found.ends, found.mode)
        event = jnp.any(found.ends)
        passed = jnp.where(event, passed + found.length, 0.0)
        place, events = place + (~event).astype(int), events + event.astype(int)
        return Place(place, passed, found.state, found.mode, events), part

    return advance


class _Reached(NamedTuple):
    """The end of a part."""

    length: Float[Array, ""]
    state: Float[Array, " s"]
    ends: Bool[Array, " k"]
    mode: Mode


def _first_event(steps: Steps, number, t, x, mode: Mode, left, wanted) -> _Reached:
    """Return the first event within the time `left`, or the motion at its end.

    Among the distances that are negative at the end, the smallest one crosses zero at
    the first event.
    """
    field, system_at = steps.field(number, mode), steps.in_mode(number, mode)
    size = steps.size
    if np.any(steps.surfaces.transitions):
        beginning = switching_distances(system_at(t), t, x[:size])

    def narrow(carried):
        turn, a, low, b, high, kept, crossed, whole, _ = carried
        trial = jnp.where(low > 0, (a * high - b * low) / (high - low), a)
        trial = jnp.where(turn == 0, left, jnp.where(turn == 1, 0.0, trial))
        there, _, _ = array_step(RK4, field, t, x, trial)
        distances = switching_distances(system_at(t + trial), t + trial, there[:size])
        whole = jnp.where(turn == 0, there, whole)
        below = distances < 0
        if np.any(steps.surfaces.transitions):
            below = below & ~_leaving(steps, beginning, distances, left)
        crossed = jnp.where(turn == 0, wanted & below, crossed)
        least = jnp.argmin(jnp.where(crossed, distances, jnp.inf))
        value, last = distances[least], (least, trial, there)
        beyond = (value < 0) & (turn != 1)
        # Illinois method: if an end of the bracket is kept twice, its value is halved
        low_kept = jnp.where((turn > 2) & beyond & (kept == 1), low / 2, low)
        high_kept = jnp.where((turn > 2) & ~beyond & (kept == 2), high / 2, high)
        return (
            turn + 1,
            jnp.where(beyond, a, trial),
            jnp.where(beyond, low_kept, value),
            jnp.where(beyond, trial, b),
            jnp.where(beyond, value, high_kept),
            jnp.where(beyond, 1, 2),
            crossed,
            whole,
            last,
        )

    def more(carried):
        turn, _, low, *_, crossed, _, _ = carried
        begins = jnp.any(crossed) & ((turn < 2) | (low > 0)) & (turn < _SEARCH)
        return (turn == 0) | begins

    zero, none = jnp.zeros((), dtype=int), jnp.zeros_like(left)
    surfaces = jnp.zeros((steps.surfaces.number,), dtype=bool)
    begin = (zero, none, none, left, -jnp.ones_like(left), zero, surfaces, x)
    *_, crossed, whole, (least, length, there) = jax.lax.while_loop(
        more, narrow, (*begin, (zero, left, x))
    )
    found = jnp.any(crossed)
    ends = found & (jnp.arange(steps.surfaces.number) == least)
    at, y = t + length, there[:size]
    system = system_at(at)
    landed = state_after(system, at, y, ends)
    new = mode_after(steps.surfaces, system, at, y, landed, ends)
    there = there.at[:size].set(landed)
    return _Reached(
        jnp.where(found, length, left),
        jnp.where(found, there, whole),
        ends,
        Mode(*(jnp.where(found, a, b) for a, b in zip(new, mode))),
    )


def _leaving(steps: Steps, begin, end, left) -> Bool[Array, " k"]:
    """Return which guards count as zero at the beginning, although they are negative:
    those that rise, by much more than this within a piece.

    In an exact motion, such a guard is zero when its mode begins. An example is the
    slip of a clutch that starts to slip. In a fit, states and thresholds have errors.

    **Arguments:** the distances after the time `left` and at its beginning.
    """
    rise = (end - begin) * (steps.count * steps.step / left)
    transitions = jnp.asarray(steps.surfaces.transitions)
    return transitions & (begin < 0) & (-begin <= _ZERO * rise)
