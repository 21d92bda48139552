"""Skip contacts whose release is known from an earlier forcing period.

In a planar system, time alone determines the state during contact. If the forcing is
periodic, a contact that begins within an earlier contact, shifted by whole periods,
therefore ends at the shifted release of that contact, in the same state. A release is
used once a second contact has ended in the same way: a `period` that is wrong by more
than 1e-8 thus skips nothing. A contact whose state is far from that of the release,
compared with the known contact, is not skipped either, because a constraint may have
several surfaces.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..codes import RowKind, RUNNING
from ..loop import Functions, iteration, Jet, LoopState, Plan, select
from ._layout import LaneLayout, LaneStart


# two releases are the same if their times differ by less than this fraction of the
# period, and their states by less than this fraction of the scale of the motion
_SAME = 1e-8
# a contact that begins farther from the release than the earlier ones, by this factor,
# is not skipped
_REACH = 2.0


class Release(NamedTuple):
    """The last contact that ended, and the motion after its release."""

    # since when the current contact has lasted, and its first state
    began: Any
    began_x: tuple
    # the contact is known to last from `start` to `end` (s), with this first state
    start: Any
    start_x: tuple
    end: Any
    # state, acceleration and jerk of the gap, and first step
    x: tuple
    acceleration: Any
    jerk: Any
    step: Any
    # whether the contact before it ended in the same way
    confirmed: Any


class ReleaseState(NamedTuple):
    """The loop state, and the release of the last contact."""

    state: LoopState
    release: Release


def may_skip(start: LaneStart) -> bool:
    """Return whether the contacts of these batch elements can be skipped."""
    _, plan = start.static
    example = start.slots.rows
    planar = len(example.x) == 2 and len(example.held) == len(example.jets) == 1
    # an infinite period is static; any other is an array
    return planar and plan.repeat is None and not plan.breaks


def with_releases(start: LaneStart) -> LaneStart:
    """Return the batch elements in `ReleaseState`s that know no release."""
    state, kinds = start.slots
    count = len(jax.tree.leaves(state))
    number = np.dtype(float)
    x, never = (0.0, 0.0), np.inf
    nothing = Release(never, x, never, x, never, x, 0.0, 0.0, 0.0, 0.0)
    values, structure = jax.tree.flatten(nothing)
    rows = jax.tree.unflatten(structure, range(count, count + len(values)))
    more = np.tile(np.array(values)[:, None], start.numbers.shape[1])
    slots = LaneLayout(ReleaseState(state, rows), (*kinds, *[number] * len(values)))
    return start._replace(slots=slots, numbers=np.concatenate([start.numbers, more]))


def iteration_past_contacts(functions: Functions, plan: Plan, carried: ReleaseState):
    """Take one attempted step; a contact whose release is known ends at once."""
    state, record = iteration(functions, plan, carried.state)
    release = _updated(plan, carried.release, state, record)
    (holds,) = state.contact
    state = functions.where(
        holds & (release.confirmed > 0), lambda: _skipped(plan, state, release), state
    )
    return ReleaseState(state, release), record


def _updated(plan: Plan, known: Release, state: LoopState, record) -> Release:
    """Return the release after an attempt, which may have ended a contact."""
    begins = record.kind == float(RowKind.CONTACT)
    ends = record.kind == float(RowKind.RELEASE)
    shift = plan.repeat * jnp.round((state.t - known.end) / plan.repeat)
    same = jnp.abs(state.t - (known.end + shift)) <= _SAME * plan.repeat
    for old, new, extent in zip(known.x, state.x, state.extents, strict=True):
        same = same & (jnp.abs(new - old) <= _SAME * (jnp.abs(new) + extent))
    # both contacts end at the same release, so the longer one contains the other
    longer = same & (known.start + shift < known.began)
    (jet,) = state.jets
    new = Release(
        began=jnp.inf,
        began_x=known.began_x,
        start=jnp.where(longer, known.start + shift, known.began),
        start_x=select(longer, known.start_x, known.began_x),
        end=state.t,
        x=state.x,
        acceleration=jet.acceleration,
        jerk=jet.jerk,
        step=state.step,
        confirmed=jnp.where(same, 1.0, 0.0),
    )
    found = jax.tree.map(lambda a, b: jnp.where(ends, a, b), new, known)
    return found._replace(
        began=jnp.where(begins, state.t, found.began),
        began_x=select(begins, state.x, found.began_x),
    )


def _skipped(plan: Plan, state: LoopState, release: Release) -> LoopState:
    """Return the state after the release, if no stop comes before it."""
    wait = jnp.where(state.completing, state.step, 0.0)
    begin, period = state.t + wait, plan.repeat
    shift = period * jnp.ceil((begin - release.end) / period)
    t = release.end + shift
    stop = jnp.minimum(plan.t0 + (state.stops + 1) * plan.stop_period, plan.t1)
    inside = begin >= release.start + shift - _SAME * period
    for a, b, first, extent in zip(
        state.x, release.x, release.start_x, state.extents, strict=True
    ):
        reach = _REACH * jnp.abs(first - b) + _SAME * (jnp.abs(b) + extent)
        inside = inside & (jnp.abs(a - b) <= reach)
    skips = inside & (t < stop) & (state.status == RUNNING)
    zero, no = 0.0 * t, jnp.asarray(False)
    after = state._replace(
        t=t,
        x=release.x,
        mode=(no,),
        jets=(Jet(zero, zero, release.acceleration, release.jerk),),
        step=jnp.minimum(state.longest, release.step),
        completing=no,
        locating=no,
        fastest=zero,
        failures=zero,
    )
    return jax.tree.map(lambda a, b: jnp.where(skips, a, b), after, state)
