"""Define one iteration of the event loop: one attempted step in the current mode.

The loop has no inner loop. A step that crosses a constraint, or may have crossed it, is
rejected; the batch element keeps its state, and the next iteration tries a better
length. All operations are scalar arithmetic and selection, so the elements of a batch,
each in its own mode, advance together. Step lengths carry no derivative, but event
times do.
"""

import functools
from typing import Any, NamedTuple

import jax.numpy as jnp

from ..breakpoints import after
from ..codes import RowKind, RUNNING
from ._advance import after_attempt, Attempt, Plan
from ._crossing import jumped_across, of_constraints, refreshed, stopped_by_impacts
from ._flight import earliest, judge, no_event, StepVerdict
from ._functions import Functions
from ._gap_polynomial import Jet
from ._jam import Jam, jam_of_step, jams_after
from ._landing import land, Landing
from ._leave_together import leave_together
from ._loop_state import COMPLETED, LoopState
from ._release import judge_contact, lets_go_before
from ._row_kind import at_section, kind_of_switch, row_kind
from ._select import any_of, of_constraint, select
from ._series import off_rounding, taylor_of_release
from ._settles import settles
from ._step import end_of_step, make_step, Step, StepEnd


class Record(NamedTuple):
    """One row of the log."""

    kind: Any
    constraint: Any
    t: Any
    before: tuple
    after: tuple
    mode: tuple
    # whether this is a point on the Poincaré section, if the system has one
    points: tuple


class Judged(NamedTuple):
    """The outcome of a step for the open gaps."""

    flown: StepVerdict
    lands: Any
    # whether the step may be accepted as far as the open gaps are concerned
    good: Any
    # whether the step ends behind a constraint that is hit after a release
    over: Any
    # the step length that the error estimate alone would allow
    natural: Any
    # for each constraint, the largest displacement that contact has suppressed, and the
    # resolution of a zero gap in contact
    held: list
    tiny: list
    # for each surface, whether sliding begins at once: see `stopped_by_impacts`
    stops: list


def iteration(
    functions: Functions, plan: Plan, carried: LoopState
) -> tuple[LoopState, Record]:
    """Take one attempted step, and return the new loop state and the log row."""
    with functions.sharing():
        return _iterate(functions, plan, carried)


def _iterate(
    functions: Functions, plan: Plan, carried: LoopState
) -> tuple[LoopState, Record]:
    active = carried.status == RUNNING
    sticking = any_of(carried.contact)
    rounding = [1e-15 * s + b for s, b in zip(carried.sizes, carried.blur, strict=True)]
    end = end_of_step(functions, plan, carried, rounding)
    made = make_step(functions, plan, carried, end)
    if carried.stale:
        carried, made = refreshed(carried, made)
    judged = _judge_flights(functions, plan, carried, end, made, rounding)
    flown, lands = judged.flown, judged.lands
    parts = lands, flown, rounding, judged.stops
    landing = land(functions, plan, carried, end, made, *parts)
    chatter, begins = landing.chatter, landing.begins

    # in contact, the state is moved onto the surface again; its change must be small
    settled = functions.onto(made.frame, landing.jets, landing.x, landing.mode)
    converged = ~sticking | settles(functions, carried, made, landing, settled)
    held = _judge_contacts(functions, carried, end, landing, judged)
    jam = jam_of_step(functions, plan, carried, end, made)
    reached = held.lands & judged.good & ~lands & converged & ~jam.near
    locates = reached & ~carried.locating & plan.exact_release
    released = reached & ~locates
    good = judged.good & ~locates & ~jam.retake
    good = good & ~(held.retake & sticking & ~lands & ~jam.near) & converged

    # the state and the jets to continue with
    delay = jnp.where(reached, held.offset, 0.0)
    left = taylor_of_release(
        functions, settled, made.rates, made.frame, landing.jets, delay, landing.mode
    )
    x, jets = off_rounding(
        made.frame, landing.jets, landing.x, landing.hit, carried.extents
    )
    x = select(begins, chatter.state, select(sticking & ~lands, left, x))
    t = landing.t + delay
    went = leave_together(functions, landing, held, released, delay)
    # a multiplier that only reaches zero has not released
    pressing = sticking & good & ~lands & ~released & ~carried.completing
    mode = tuple(
        (landing.mode[k] | landing.closing[k]) & ~went[k] & active
        for k in range(functions.m)
    )
    mode = mode + tuple(landing.mode[functions.m :])
    jets = _next_jets(carried, jets, landing, went, pressing, delay)
    if plan.breaks:
        # the motion after a breakpoint is evaluated on its far side
        passed = end.at_stop & (end.stop < end.asked) & good & ~lands & ~released
        jets = _where_passed(functions, plan, passed, t, x, mode, jets)
    finite = jnp.isfinite(sum(x) + t + sum(j.gap + j.velocity for j in jets))
    good = good & finite
    stopped = end.at_stop & (end.stop >= end.asked) & good & ~lands & ~released
    attempt = Attempt(
        t=t,
        x=x,
        mode=mode,
        jets=jets,
        arrived=tuple(made.jets),
        tried=tuple(jnp.abs(b - a) for a, b in zip(carried.x, made.raw, strict=True)),
        length=end.length,
        effort=made.effort,
        good=good,
        fits=made.effort <= 1.0,
        finite=finite,
        shorter=_shorter(functions, end, judged, held, converged, jam),
        # the initial guess of the next attempt to find the state in contact
        guess=left if functions.planar else carried.x,
        settling=~converged & functions.planar,
        stopped=stopped,
        lands=lands,
        hit=landing.hit,
        hidden=landing.hidden,
        loses=landing.loses,
        points=at_section(functions, carried, landing, lands),
        strikes=landing.strikes,
        stuck=landing.stuck,
        jams=active & jams_after(functions, jam, good, begins, landing.seen, x, mode),
        stale=_stale(carried, landing, released),
        begins=begins,
        locates=locates,
        released=released,
        fastest=landing.fastest,
        fixed=jnp.where(locates, end.length + delay, chatter.duration),
        blur=landing.blur,
        held=_suppressed(carried, judged),
    )
    kind = row_kind(carried, lands, begins, released, stopped)
    if functions.k:
        kind = kind_of_switch(carried, landing, lands, kind)
    record = Record(
        kind=jnp.where(good & active, kind, float(RowKind.NOTHING)),
        constraint=jnp.where(released, held.constraint, flown.constraint),
        t=t,
        before=select(lands, landing.impact.before, x),
        after=select(begins, landing.impact.after, x),
        mode=mode,
        points=tuple(p & good & active for p in attempt.points),
    )
    return after_attempt(functions, plan, carried, attempt), record


def _suppressed(carried: LoopState, judged: Judged) -> tuple:
    """Return the largest displacement that each contact has suppressed."""
    pairs = zip(carried.contact, judged.held, carried.held, strict=True)
    return tuple(jnp.where(c, new, old) for c, new, old in pairs)


def _judge_flights(
    functions: Functions,
    plan: Plan,
    carried: LoopState,
    end: StepEnd,
    made: Step,
    rounding,
) -> Judged:
    """Detect events at the open gaps, and at the switching surfaces."""
    h, jets = end.length, made.jets
    slack = [2e-12 * s + b for s, b in zip(carried.sizes, carried.blur, strict=True)]
    free = [~c for c in carried.closed]
    if carried.stale:
        # surfaces are not checked while a chatter is completed, because the contact
        # that follows may change the end of sliding
        m = len(carried.held)
        free[m:] = [f & ~carried.completing for f in free[m:]]

    def verdict(k: int, jet: Jet) -> StepVerdict:
        return judge(
            carried.jets[k],
            jet,
            h,
            slack[k],
            rounding[k],
            carried.sizes[k],
            end.room,
            carried.longest,
            calm=functions.counts is not None and k + 1 == len(jets),
            held=k < functions.m and bool(functions.slidable),
            where=functions.where,
        )

    verdicts = [
        functions.where(free[k], functools.partial(verdict, k, jet), no_event(h))
        for k, jet in enumerate(jets)
    ]
    stops = stopped_by_impacts(functions, carried) if carried.crossed else []
    if carried.crossed:
        verdicts = jumped_across(carried, verdicts, h, stops)
    flown = earliest(verdicts)
    natural = jnp.minimum(carried.longest, plan.longest_step)
    # the displacement that the multipliers suppress also counts, because rounding is
    # relative to it
    held = [
        jnp.maximum(s, natural * natural * jnp.abs(j.acceleration))
        for s, j in zip(carried.held, carried.jets, strict=False)
    ]
    tiny = [r + 1e-15 * s for r, s in zip(rounding, held, strict=False)]
    fits = made.effort <= 1.0
    active = carried.status == RUNNING
    waits = _waits_for_release(carried, jets, flown, natural, tiny)
    lands = flown.lands & fits & active & ~waits
    # the step to a release must not end behind the constraint that is hit after it
    behind = of_constraint([j.gap for j in jets], flown.constraint)
    over = waits & (behind < -of_constraint(slack, flown.constraint))
    good = fits & ~flown.retake & ~over & active
    return Judged(flown, lands, good, over, natural, held, tiny, stops)


def _judge_contacts(
    functions: Functions,
    carried: LoopState,
    end: StepEnd,
    landing: Landing,
    judged: Judged,
) -> StepVerdict:
    """Detect releases at the closed gaps."""
    h, none = end.length, no_event(end.length)
    flags = carried.completing, carried.locating

    def verdict(k: int, tiny) -> StepVerdict:
        jets, limits = (carried.jets[k], landing.jets[k]), (judged.natural, tiny)
        found = judge_contact(*jets, h, *limits, end.room, *flags)
        return _where_in_force(carried.contact[k], found)

    if not carried.held:
        return none
    return functions.where(
        any_of(carried.contact),
        lambda: earliest([verdict(k, tiny) for k, tiny in enumerate(judged.tiny)]),
        none,
    )


def _shorter(
    functions, end: StepEnd, judged: Judged, held: StepVerdict, converged, jam: Jam
):
    """Return the step length to try next if the step is not accepted."""
    shorter = jnp.minimum(judged.flown.length, held.length)
    to_impact = jnp.minimum(shorter, end.length + judged.flown.offset)
    shorter = jnp.where(judged.over, to_impact, shorter)
    if functions.rubs:
        shorter = jnp.minimum(shorter, jam.length)
    if functions.planar:
        return shorter
    return jnp.where(converged, shorter, 0.5 * end.length)


def _stale(carried, landing: Landing, released) -> tuple:
    """Return the flag for jets that are not those of the new mode: see `LoopState`."""
    if not carried.stale:
        return ()
    after = jnp.where(released, 1.0, jnp.where(carried.completing, COMPLETED, 0.0))
    return (jnp.where(landing.slides, 2.0, after),)


def _next_jets(carried, jets, landing: Landing, went, pressing, delay):
    """Return the jets for the next step, in which rounding must not undo a contact.

    On the surface, the gap is zero; at a release, the velocity is also zero and the
    acceleration is not compressive. A completed chatter continues with the acceleration
    at its end.
    """
    hit, chatter, after = landing.hit, landing.chatter, []
    for k, jet in enumerate(jets):
        if k >= len(went):
            after.append(jet)
            continue
        ends = landing.closing[k]
        held = jnp.where(
            pressing & carried.contact[k],
            jnp.minimum(jet.acceleration, 0.0),
            jet.acceleration,
        )
        acceleration = jnp.where(ends, landing.pulls[k], held)
        after.append(
            Jet(
                jnp.where(went[k] | hit[k] | ends, 0.0, jet.gap),
                jnp.where(went[k], 0.0, jet.velocity),
                jnp.where(
                    went[k],
                    jnp.maximum(jet.acceleration + delay * jet.jerk, 0.0),
                    acceleration,
                ),
                jnp.where(ends, chatter.rate, jet.jerk),
            )
        )
    if carried.stale:
        same = of_constraints(carried, carried.jets, after)
        rest = [landing.strikes] * (len(after) - len(went))
        fresh = [*(landing.strikes | one for one in went), *rest]
        after = [
            Jet(*select(now, new, old)) for now, new, old in zip(fresh, after, same)
        ]
    return tuple(after)


def _waits_for_release(carried, jets, flown, natural, tiny):
    """Return whether a contact releases before the impact that was found in a step.

    The impact is logged after the release.
    """
    if len(jets) == 1:
        return jnp.asarray(False)
    lets_go = [
        c & lets_go_before(jet, flown.offset, natural, least)
        for c, jet, least in zip(carried.contact, jets, tiny, strict=False)
    ]
    return flown.lands & any_of(lets_go) & ~carried.completing


def _where_passed(functions, plan, passed, t, x, mode, jets):
    """Return the jets, on the far side of a breakpoint if one was passed."""
    fresh = functions.jets(after(t, plan.t1 - plan.t0), x, mode)
    return tuple(
        Jet(*select(passed, new, old)) for new, old in zip(fresh, jets, strict=True)
    )


def _where_in_force(condition, verdict):
    return StepVerdict(*select(condition, verdict, no_event(verdict.length)))
