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
from ._chatter import completion_time
from ._codes import Row
from ._flight import earliest, judge, moves_in
from ._functions import Functions
from ._gap_polynomial import Jet
from ._lane import Lane, RUNNING
from ._release import judge_contact
from ._runge_kutta import step
from ._select import any_of, largest, pick, select


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
    rounding = [1e-15 * s + 2e-15 * size for s in lane.scale]
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
    effort = _error_norm(error, lane.x, x1, plan.tolerance)
    if functions.planar:
        # contact is algebraic: the old state is the guess
        x1 = select(sticking, lane.x, x1)
        effort = jnp.where(sticking, 0.0, effort)
    jets1 = functions.jets(t1, x1, lane.contact)
    frame = functions.frame(t1, x1)
    projected = functions.onto(frame, jets1, x1, lane.contact)

    # what happened in it
    slack = [2e-12 * s + 1e-15 * size for s in lane.scale]
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
    landed = _taylor(projected, rates, offset)
    t2 = t1 + offset
    after_each = functions.impact(t2, landed)
    x_after = after_each[0]
    for k in range(1, m):
        x_after = select(flown.constraint == k, after_each[k], x_after)
    v_before = pick(
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
    chatter = _chatter(
        functions,
        plan,
        lane,
        t2,
        landed,
        x_after,
        v_before,
        rebound,
        jets3,
        flown,
        stop,
    )
    # deep enough into the sequence, or so low that rounding hides the next hop
    pulled = jnp.abs(pick([j.acceleration for j in jets3], flown.constraint))
    deep = rebound <= plan.depth * fastest
    hidden = rebound * rebound <= 1e-12 * size * pulled
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
    left = _taylor_of_release(functions, settled, rates, frame, jets3, delay, contact)
    x4 = select(sticking & ~lands, left, _off_rounding(frame, jets3, x3, hit))
    x4 = select(begins, chatter.state, x4)
    t4 = t2 + delay

    # the lane after the step
    went = [released & (held.constraint == k) for k in range(m)]
    # who only touches zero still presses
    pressing = sticking & good & ~lands & ~released & ~lane.completing
    contact4 = tuple(
        (contact[k] | (begins & hit[k])) & ~went[k] & active for k in range(m)
    )
    jets4 = tuple(
        Jet(
            # on the surface the gap is zero, whatever rounding makes of it
            jnp.where(went[k] | hit[k], 0.0, jets3[k].gap),
            jnp.where(went[k], 0.0, jets3[k].velocity),
            jnp.where(
                went[k],
                0.0,
                jnp.where(
                    begins & hit[k],
                    chatter.acceleration,
                    jnp.where(
                        pressing & lane.contact[k],
                        jnp.minimum(jets3[k].acceleration, 0.0),
                        jets3[k].acceleration,
                    ),
                ),
            ),
            jnp.where(begins & hit[k], chatter.rate, jets3[k].jerk),
        )
        for k in range(m)
    )
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
    )
    lane4 = advance_lane(plan, lane, attempt)
    kind = jnp.where(
        lands,
        jnp.where(begins, float(Row.LAST_IMPACT), float(Row.IMPACT)),
        jnp.where(
            released,
            float(Row.RELEASE),
            jnp.where(
                lane.completing,
                float(Row.CONTACT),
                jnp.where(stopped, float(Row.STOP), float(Row.STEP)),
            ),
        ),
    )
    record = Record(
        kind=jnp.where(good & active, kind, float(Row.NOTHING)),
        constraint=jnp.where(released, held.constraint, flown.constraint),
        t=t4,
        before=select(lands, landed, x4),
        after=select(begins, x_after, x4),
        contact=contact4,
    )
    return lane4, record


class _Chatter(NamedTuple):
    possible: Any
    duration: Any
    state: tuple
    acceleration: Any
    rate: Any


def _chatter(
    functions, plan, lane, t, before, after, v_before, rebound, jets, flown, stop
) -> _Chatter:
    """The completion of the sequence after this impact, and whether it may be used."""
    dampings, restitutions, states = functions.chatter(t, before, after)
    damping = pick(dampings, flown.constraint)
    r0 = pick(restitutions, flown.constraint)
    state = states[0]
    for k in range(1, functions.m):
        state = select(flown.constraint == k, states[k], state)
    a = pick([j.acceleration for j in jets], flown.constraint)
    j = pick([j.jerk for j in jets], flown.constraint)
    small = rebound * jnp.abs(j) <= plan.smallness * (1 - r0) * a * a
    possible = (a < 0) & small & (r0 < 1)
    # quantities of the state without normal velocity
    a = jnp.where(possible, a - damping * rebound, -1.0)
    rate = j - damping * a
    r0 = jnp.where(possible, r0, 0.0)
    incoming = jnp.where(v_before < 0, -v_before, 1.0)
    inverse = 1 / incoming
    softening = (rebound * inverse - r0) * inverse
    duration = completion_time(rebound, a, rate, damping, r0, softening)
    at_end = a + rate * duration
    soon = (t + duration <= stop) | (duration <= 1e-13 * jnp.abs(t))
    return _Chatter(possible & (a < 0) & (at_end < 0) & soon, duration, state, a, rate)


def _kept_contacts(functions, lane, lands, t, x):
    """An impact on one constraint may throw the system off another it rests on."""
    if functions.m == 1:
        return lane.contact
    speeds = functions.velocity(t, x)
    return tuple(
        c & (~lands | (jnp.abs(v) <= 1e-12 * (1.0 + lane.fastest)))
        for c, v in zip(lane.contact, speeds, strict=True)
    )


def _off_rounding(frame, jets, x, hit):
    """The state after an impact without the gap that rounding left it.

    It would add up over the impacts of a chatter, whose last hops are lower than it.
    """
    for direction, jet, here in zip(frame.lift, jets, hit, strict=True):
        gap = jax.lax.stop_gradient(jnp.where(here, jet.gap, 0.0))
        x = tuple(a - gap * b for a, b in zip(x, direction, strict=True))
    return x


def _taylor(x, rates, tau):
    first, second, third = rates
    return tuple(
        x[i] + tau * (first[i] + tau * (second[i] / 2 + tau * third[i] / 6))
        for i in range(len(x))
    )


def _taylor_of_release(functions, x, rates, frame, jets, tau, contact):
    """The sticking motion over the short time to release, to second order."""
    first, second, _ = rates
    if not functions.planar:
        return tuple(
            x[i] + tau * (first[i] + tau * second[i] / 2) for i in range(len(x))
        )
    # F_s = F - a D: with a = 0 at release only its rate remains
    a, rate = jets[0].acceleration, jets[0].jerk
    push = frame.push[0]
    return tuple(
        jnp.where(
            contact[0],
            x[i]
            + tau * (first[i] - a * push[i] + tau * (second[i] - rate * push[i]) / 2),
            x[i],
        )
        for i in range(len(x))
    )


def _error_norm(error, before, after, tolerance):
    parts = [
        jnp.abs(e) / (tolerance * (1.0 + jnp.maximum(jnp.abs(a), jnp.abs(b))))
        for e, a, b in zip(error, before, after, strict=True)
    ]
    return largest(parts)


def _where_free(free, verdict):
    return verdict._replace(
        retake=verdict.retake & free,
        length=jnp.where(free, verdict.length, jnp.inf),
        lands=verdict.lands & free,
    )
