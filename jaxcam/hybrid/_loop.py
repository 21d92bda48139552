"""The event loop: one iteration, one attempt at a step of whatever mode is in force.

There is no loop within the loop. A step that crosses a constraint, or might have, is
not accepted; the lane stays where it is and the next iteration tries a better length.
Everything is arithmetic on scalars and selection, so that a batch of lanes, each in its
own mode, advances together; lengths of steps carry no derivative, times of events do.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ._advance import advance_lane, Attempt, Plan
from ._codes import Row
from ._flight import earliest, judge, moves_in
from ._functions import Functions
from ._gap_polynomial import Jet
from ._lane import Lane, RUNNING
from ._release import judge_contact
from ._rest_of_chatter import Impact, rest_of_chatter
from ._runge_kutta import error_norm, step
from ._select import any_of, largest, pick, select
from ._series import off_rounding, taylor, taylor_of_release


class Record(NamedTuple):
    """One row of the log."""

    kind: Any
    constraint: Any
    t: Any
    before: tuple
    after: tuple
    contact: tuple


def iterate(functions: Functions, plan: Plan, lane: Lane) -> tuple[Lane, Record]:
    """One attempt at a step."""
    with functions.sharing():
        return _iterate(functions, plan, lane)


def _iterate(functions: Functions, plan: Plan, lane: Lane) -> tuple[Lane, Record]:
    m = functions.m
    active = lane.status == RUNNING
    sticking = any_of(lane.contact)
    free = [~c for c in lane.contact]

    # where the step ends
    stop = jnp.minimum(plan.t0 + (lane.stops + 1) * plan.stop_period, plan.t1)
    size = largest([jnp.abs(e) for e in lane.x])
    # time, and a phase made of it, are rounded by two parts in 1e16 each
    late = [4e-16 * jnp.abs(lane.t) * rate for rate in lane.drift]
    rounding = [
        1e-15 * s + 2e-15 * size + more
        for s, more in zip(lane.scale, late, strict=True)
    ]
    # already in contact and moving in, or in contact and pulled away: no time passes
    now = any_of(
        [
            jnp.where(c, j.acceleration > 0, (j.gap <= 0) & moves_in(j, near))
            for j, c, near in zip(lane.jets, lane.contact, rounding, strict=True)
        ]
    )
    wanted = jnp.where(now, 0.0, jax.lax.stop_gradient(lane.step))
    at_stop = (lane.t + wanted >= stop) & ~lane.completing
    h = jnp.where(at_stop, stop - lane.t, jnp.where(lane.completing, lane.step, wanted))
    h = jnp.where(active, h, 0.0)
    t1 = jnp.where(at_stop, stop, lane.t + h)
    room = jnp.where(at_stop, 0.0, stop - t1)

    # the step itself
    x1, error, _ = step(
        plan.tableau,
        lambda t, x: functions.field(t, x, lane.contact),
        lane.t,
        lane.x,
        h,
    )
    effort = error_norm(error, lane.x, x1, plan.tolerance)
    if functions.planar:
        # contact is algebraic: the old state is the guess
        x1 = select(sticking, lane.x, x1)
        effort = jnp.where(sticking, 0.0, effort)
    jets1 = functions.jets(t1, x1, lane.contact)
    frame = functions.frame(t1, x1)
    projected = functions.onto(frame, jets1, x1, lane.contact)

    # what happened in it
    slack = [
        2e-12 * s + 1e-15 * size + more
        for s, more in zip(lane.scale, late, strict=True)
    ]
    flown = earliest(
        [
            _where_free(
                free[k],
                judge(
                    lane.jets[k],
                    jets1[k],
                    h,
                    slack[k],
                    rounding[k],
                    lane.scale[k],
                    room,
                ),
            )
            for k in range(m)
        ]
    )
    fits = effort <= 1.0
    lands = flown.lands & fits & active
    good = fits & ~flown.retake & active

    # landing and impact
    offset = jnp.where(lands, flown.offset, 0.0)
    rates = functions.taylor(t1, projected, lane.contact)
    landed = taylor(projected, rates, offset)
    t2 = t1 + offset
    after_each = functions.impact(t2, landed)
    x_after = after_each[0]
    for k in range(1, m):
        x_after = select(flown.constraint == k, after_each[k], x_after)
    approach = pick(
        [j.velocity + offset * (j.acceleration + offset * j.jerk / 2) for j in jets1],
        flown.constraint,
    )
    x3 = select(lands, x_after, projected)
    contact = _kept_contacts(functions, lane, lands, t2, x3)
    jets3 = functions.jets(t2, x3, contact)

    # does the rest of the impacts follow in no time?
    hit = [lands & (flown.constraint == k) for k in range(m)]
    rebound = jnp.maximum(pick([j.velocity for j in jets3], flown.constraint), 0.0)
    fastest = jnp.where(lands, jnp.maximum(lane.fastest, rebound), lane.fastest)
    impact = Impact(t2, landed, x_after, approach, rebound, flown.constraint)
    chatter = rest_of_chatter(functions, plan, impact, jets3, stop)
    # deep enough into the sequence, or so low that rounding hides the next hop
    pulled = jnp.abs(pick([j.acceleration for j in jets3], flown.constraint))
    deep = rebound <= plan.depth * fastest
    # a hop is v^2 / 2a high: hidden below 250 times the rounding
    low = 1e-12 * size + 500 * pick(late, flown.constraint)
    hidden = rebound * rebound <= low * pulled
    begins = lands & chatter.possible & (deep | hidden)

    # contact: the state is put on the surface a second time, then judged
    settled = functions.onto(frame, jets3, x3, contact)
    moved = largest([jnp.abs(a - b) for a, b in zip(settled, x3, strict=True)])
    converged = ~sticking | (moved <= 1e-7 * (1.0 + size))
    scale = jnp.minimum(lane.longest, plan.longest_step)
    held = earliest(
        [
            _where_free(
                lane.contact[k],
                judge_contact(
                    lane.jets[k],
                    jets3[k],
                    h,
                    scale,
                    rounding[k],
                    room,
                    lane.completing,
                ),
            )
            for k in range(m)
        ]
    )
    released = held.lands & good & ~lands & converged
    good = good & ~(held.retake & sticking & ~lands) & converged
    delay = jnp.where(released, held.offset, 0.0)
    left = taylor_of_release(functions, settled, rates, frame, jets3, delay, contact)
    x4 = select(sticking & ~lands, left, off_rounding(frame, jets3, x3, hit))
    x4 = select(begins, chatter.state, x4)
    t4 = t2 + delay

    # the lane after the step
    went = [released & (held.constraint == k) for k in range(m)]
    # who only touches zero still presses
    pressing = sticking & good & ~lands & ~released & ~lane.completing
    contact4 = tuple(
        (contact[k] | (begins & hit[k])) & ~went[k] & active for k in range(m)
    )
    jets4 = _next_jets(lane, jets3, chatter, hit, went, begins, pressing)
    finite = jnp.isfinite(sum(x4) + t4 + sum(j.gap + j.velocity for j in jets4))
    good = good & finite
    stopped = at_stop & good & ~lands & ~released
    shorter = jnp.minimum(flown.length, held.length)
    if not functions.planar:
        shorter = jnp.where(converged, shorter, 0.5 * h)
    attempt = Attempt(
        t=t4,
        x=x4,
        contact=contact4,
        jets=jets4,
        arrived=tuple(jets1),
        length=h,
        effort=effort,
        good=good,
        fits=fits,
        finite=finite,
        shorter=shorter,
        # algebraic contact may start its next attempt from here
        guess=settled if functions.planar else lane.x,
        settling=~converged & functions.planar,
        stopped=stopped,
        lands=lands,
        begins=begins,
        released=released,
        fastest=fastest,
        completion=chatter.duration,
        drift=functions.drift(t2, x3),
    )
    lane4 = advance_lane(plan, lane, attempt)
    kind = _kind(lane, lands, begins, released, stopped)
    record = Record(
        kind=jnp.where(good & active, kind, float(Row.NOTHING)),
        constraint=jnp.where(released, held.constraint, flown.constraint),
        t=t4,
        before=select(lands, landed, x4),
        after=select(begins, x_after, x4),
        contact=contact4,
    )
    return lane4, record


def _kind(lane, lands, begins, released, stopped):
    """What an accepted attempt is in the log: see `Row`."""
    kind = jnp.where(stopped, float(Row.STOP), float(Row.STEP))
    kind = jnp.where(lane.completing, float(Row.CONTACT), kind)
    kind = jnp.where(released, float(Row.RELEASE), kind)
    impact = jnp.where(begins, float(Row.LAST_IMPACT), float(Row.IMPACT))
    return jnp.where(lands, impact, kind)


def _next_jets(lane, jets, chatter, hit, went, begins, pressing):
    """The jets a lane goes on with: what contact has decided, rounding must not undo.

    On the surface the gap is zero, at a release velocity and acceleration are too; a
    chatter that completes goes on with the acceleration of its end.
    """
    after = []
    for k, jet in enumerate(jets):
        ends = begins & hit[k]
        held = jnp.where(
            pressing & lane.contact[k],
            jnp.minimum(jet.acceleration, 0.0),
            jet.acceleration,
        )
        acceleration = jnp.where(ends, chatter.acceleration, held)
        after.append(
            Jet(
                jnp.where(went[k] | hit[k], 0.0, jet.gap),
                jnp.where(went[k], 0.0, jet.velocity),
                jnp.where(went[k], 0.0, acceleration),
                jnp.where(ends, chatter.rate, jet.jerk),
            )
        )
    return tuple(after)


def _kept_contacts(functions, lane, lands, t, x):
    """An impact on one constraint may throw the system off another it rests on."""
    if functions.m == 1:
        return lane.contact
    speeds = functions.velocity(t, x)
    return tuple(
        c & (~lands | (jnp.abs(v) <= 1e-12 * (1.0 + lane.fastest)))
        for c, v in zip(lane.contact, speeds, strict=True)
    )


def _where_free(free, verdict):
    return verdict._replace(
        retake=verdict.retake & free,
        length=jnp.where(free, verdict.length, jnp.inf),
        lands=verdict.lands & free,
    )
