"""The state of one trajectory between two iterations of the loop."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool

from ..codes import ACCUMULATES, PAINLEVE, RUNNING
from ..surface import forced_time, start_room
from ._functions import Functions
from ._gap_polynomial import Jet
from ._scale import first_extents, first_step
from ._select import any_of, select
from ._start import first_sides, first_status


# the flag `stale` after a chatter has been completed
COMPLETED = 1.5
# the initial scale of the distance from a surface is at least the distance that the
# motion covers in this fraction of the longest step
_PART = 1e-6


class LoopState(NamedTuple):
    """The loop state as scalars, so that a batch is a set of plain vectors."""

    t: Any
    x: tuple
    # see `Functions`
    mode: tuple
    # of each constraint, then of each switching surface
    jets: tuple
    # the next step to try, and the longest one that the error allows
    step: Any
    longest: Any
    # whether this step ends at an accumulation point, or at a release, so that its
    # length is fixed
    completing: Any
    locating: Any
    stops: Any
    # fastest rebound since the last release; largest gap of each constraint
    fastest: Any
    scale: tuple
    # resolution of each gap
    blur: tuple
    # for each constraint, the largest displacement that contact has suppressed: that
    # which the multiplier would cause in the longest allowed step
    held: tuple
    # for several constraints: time of the last impact on each, and number of
    # consecutive impacts whose flights are below rounding
    struck: tuple
    crowded: tuple
    # for switching surfaces: time of the last crossing
    crossed: tuple
    # for a Poincaré section: number of crossings
    points: tuple
    # for surfaces along which a motion can slide: positive if the mode has changed
    # since the jets were computed, so that the jets of surfaces (1), or also those of
    # constraints (2), are old; `COMPLETED` (only surfaces) after a completed chatter
    stale: tuple
    # for surfaces along which a motion can slide, if there are constraints: after a
    # completed chatter, whether the last impact before it has already moved the state
    # across each of them
    thrown: tuple
    # start value and largest excursion of each component: see `_scale.py`
    origin: tuple
    extents: tuple
    # limit on the first steps, which grows with each accepted step
    ramp: Any
    failures: Any
    # a code of `codes.py`
    status: Any
    steps: Any
    impacts: Any
    # number of completed chatters
    chatters: Any

    @property
    def flags(self) -> Bool[Array, " flags"]:
        """The mode as an array."""
        return jnp.stack(self.mode) if self.mode else jnp.zeros(0, bool)

    @property
    def contact(self) -> tuple:
        """Whether each constraint is in contact."""
        return self.mode[: len(self.held)]

    @property
    def closed(self) -> tuple:
        """For each jet, whether its constraint is in contact; a surface is not."""
        return closed(self.mode, len(self.held), len(self.jets))

    @property
    def negative(self) -> tuple:
        """For each switching surface, whether the motion is on its negative side."""
        return self.mode[len(self.held) : len(self.jets)]

    @property
    def sliding(self) -> tuple:
        """Whether the motion slides along each switching surface."""
        return self.mode[len(self.jets) :]

    @property
    def sizes(self) -> tuple:
        """The largest value of each distance so far; 1 while the motion slides."""
        if not self.stale:
            return self.scale
        sliding = (jnp.asarray(False),) * len(self.held) + self.sliding
        pairs = zip(sliding, self.scale, strict=True)
        return tuple(jnp.where(slides, 1.0, s) for slides, s in pairs)

    @property
    def behind(self) -> list:
        """For each switching surface, whether a jump of the state has crossed it; or,
        while the motion slides, whether the condition for sliding is violated.
        """
        parts = (self.jets, self.sizes, self.blur)
        rest = (part[len(self.held) :] for part in parts)
        return [j.gap < -(2e-12 * s + b) for j, s, b in zip(*rest, strict=True)]

    @property
    def passed_over(self) -> list:
        """For each switching surface, whether the completion of a chatter has moved the
        state past it.

        If friction stops the slip during a chatter, its completion moves the slip
        velocity beyond zero. But an impact may also reverse a slip.
        """
        if not self.thrown:
            return [jnp.asarray(False) for _ in self.negative]
        completed = self.stale[0] == COMPLETED
        pairs = zip(self.behind, self.thrown, strict=True)
        return [completed & behind & ~thrown for behind, thrown in pairs]


def loop_state(lane: Any) -> LoopState:
    """Return the loop state of a batch element, which may carry more than that."""
    return lane if isinstance(lane, LoopState) else lane.state


def closed(mode: tuple, constraints: int, jets: int) -> tuple:
    """Return a flag for each of the `jets`: whether its constraint is in contact, and
    False for a switching surface.
    """
    rest = range(jets - constraints)
    return mode[:constraints] + tuple(jnp.asarray(False) for _ in rest)


def first_state(
    functions: Functions, t0, x, t1, longest=jnp.inf, period=jnp.inf
) -> LoopState:
    """Return the first loop state, with contact if gap and velocity are zero and a < 0.

    Without a normal force, contact is assumed; it ends as soon as a tensile force acts.
    The state of an invalid start becomes NaN. `longest` is the longest allowed step
    (s), and `period` the period of the forcing (s).
    """
    with functions.sharing():
        return _first_state(functions, t0, x, t1, longest, period)


def _first_state(functions: Functions, t0, x, t1, longest, period) -> LoopState:
    time = forced_time(period)
    # flags that are known now, not only in the program, make it shorter
    m, free = functions.m, (np.bool_(False),) * functions.m
    sides, crossings, slides, stuck = first_sides(functions, t0, x, free, time)
    free = free + sides
    jets = functions.jets(t0, x, free)[:m] if m else []
    # only used without contact
    rates = functions.taylor(t0, x, free)
    lifts, left = functions.lift(t0, x, free)
    whole = functions.blur(t0, x, (0.0,) * functions.n, free)
    blurs = whole[:m], functions.speed_blur(t0, x, free)
    tinies, slows = (
        [start_room(b, j.acceleration, s) for b, j in zip(each, jets, strict=True)]
        for each, s in zip(blurs, (time * time, time), strict=True)
    )
    status = first_status(t0, x, t1, [jet.gap for jet in jets], tinies)
    if crossings:
        status = jnp.where((status == RUNNING) & stuck, ACCUMULATES, status)
    origin, extents = first_extents(lifts, left, jets, tinies, x)
    settled, touched = [], []
    for jet, lift, tiny, slow in zip(jets, lifts, tinies, slows, strict=True):
        gap, velocity = jet.gap, jet.velocity
        near = jnp.abs(gap) <= tiny
        # flights lower than rounding, and the impacts before them, count as contact
        hop = tiny * jnp.abs(jet.acceleration)
        low = (jet.acceleration < 0) & (velocity * velocity <= hop)
        touching = near & ((jnp.abs(velocity) <= slow) | low)
        touched.append(touching)
        # off the surface, the start is unchanged; on it, rounding is removed
        behind = near & (gap < 0)
        shift = jax.lax.stop_gradient(jnp.where(behind, gap, 0.0))
        x = tuple(a - shift * b for a, b in zip(x, lift, strict=True))
        settled.append(
            Jet(
                jnp.where(touching | behind, 0.0, gap),
                jnp.where(touching, 0.0, jet.velocity),
                jet.acceleration,
                jet.jerk,
            )
        )
    pulls = [jet.acceleration for jet in settled]
    if functions.joins:
        several = sum(jnp.where(flag, 1.0, 0.0) for flag in touched) > 1
        pulls = functions.where(
            several, lambda: functions.pressed(t0, x, touched, free), tuple(pulls)
        )
    contact = [
        flag & _presses(jet._replace(acceleration=pull), tiny) & (status == RUNNING)
        for flag, jet, pull, tiny in zip(touched, settled, pulls, tinies, strict=True)
    ]
    if m and functions.slidable:
        # contact forces and their friction may also hold the motion on a surface
        found = first_sides(functions, t0, x, tuple(contact), time)
        sides, crossings, slides, stuck = found
        status = jnp.where((status == RUNNING) & stuck, ACCUMULATES, status)
    longest = jnp.minimum((t1 - t0) / 64, longest)
    # in contact, the error estimate may be uninformative, so the step length is limited
    held = any_of(contact)
    mode = tuple(contact) + sides
    settled += crossings
    first = jnp.where(held, longest, first_step(extents, rates, t0, longest))
    x = select(status == RUNNING, x, (jnp.nan,) * len(x))
    if functions.rubs:
        least = functions.compliance(t0, x, (*touched, *sides))
        status = jnp.where((status == RUNNING) & (least <= 0), PAINLEVE, status)
    one = jnp.ones_like(t0)
    return LoopState(
        t=t0,
        x=x,
        mode=mode,
        jets=tuple(settled),
        step=first,
        longest=longest * one,
        completing=jnp.asarray(False),
        locating=jnp.asarray(False),
        stops=0.0 * one,
        fastest=0.0 * one,
        scale=_first_scale(settled, m, longest),
        blur=tuple(map(jax.lax.stop_gradient, functions.blur(t0, x, extents, mode))),
        held=(0.0 * one,) * m,
        struck=(-jnp.inf * one,) * m if m > 1 else (),
        crowded=(0.0 * one,) if m > 1 else (),
        crossed=(-jnp.inf * one,) if functions.k else (),
        points=() if functions.counts is None else (0.0 * one,),
        stale=(jnp.where(slides, 2.0, jnp.where(held, 1.0, 0.0)),)
        if functions.slidable or functions.counts is not None
        else (),
        thrown=(jnp.asarray(False),) * functions.k if m and functions.slidable else (),
        origin=origin,
        extents=extents,
        ramp=first,
        failures=0.0 * one,
        status=status,
        steps=0.0 * one,
        impacts=0.0 * one,
        chatters=0.0 * one,
    )


def _first_scale(jets, m: int, longest) -> tuple:
    """Return the initial scales of the gaps, and of the distances from surfaces.

    A distance that is zero at the start, such as that of a body that sticks, still has
    a scale: the distance that the motion off the surface covers in a small part of the
    longest step.
    """
    moves = [jnp.abs(j.velocity) * longest * _PART for j in jets[m:]]
    sizes = [jnp.abs(jet.gap) for jet in jets]
    far = [jnp.maximum(a, b) for a, b in zip(sizes[m:], moves, strict=True)]
    return tuple(map(jax.lax.stop_gradient, [*sizes[:m], *far]))


def _presses(jet: Jet, tiny):
    """Return whether a constraint that is touched with zero velocity is under
    compression, or about to be.

    A flight due to acceleration and jerk whose height 2 a^3 / (3 j^2) does not exceed
    `tiny` is ignored.
    """
    a, j = jet.acceleration, jet.jerk
    return (a < 0) | ((j <= 0) & (2 * a * a * a <= 3 * tiny * j * j))
