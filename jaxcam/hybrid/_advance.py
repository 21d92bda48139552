"""What becomes of a lane after an attempt at a step, and what it tries next."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ._gap_polynomial import end_curvature, Jet, time_to_contact, time_to_release
from ._lane import FINISHED, Lane, NOT_FINITE, RUNNING, STEP_FAILED
from ._runge_kutta import Tableau, tableau_of
from ._select import any_of, select


# consecutive attempts without progress in time after which a lane gives up
_PATIENCE = 80
# steps in a period of the forcing, at least
_PARTS = 4


class Plan(NamedTuple):
    """What does not change during a run; scalars, except for the tableau."""

    t0: Any
    t1: Any
    # the run also stops, and records, at t0 + k stop_period
    stop_period: Any
    # so short that no whole rise and fall of a surface fits in, where the error of a
    # step says nothing: in contact, and at rest without a force
    longest_step: Any
    tolerance: Any
    smallness: Any
    depth: Any
    tableau: Tableau

    @staticmethod
    def of(system, settings, t0, t1, *, period=None, stop_period=jnp.inf) -> "Plan":
        """The plan of a run from `t0` to `t1`; `period` is the system's own without."""
        period = system.period if period is None else period
        return Plan(
            t0=t0,
            t1=t1,
            stop_period=stop_period,
            longest_step=jnp.inf if period is None else period / _PARTS,
            tolerance=settings.tolerance,
            smallness=settings.chatter_smallness,
            depth=settings.chatter_depth,
            tableau=tableau_of(settings.solver),
        )


class Attempt(NamedTuple):
    """An attempt at a step: where it led, and what was found out."""

    t: Any
    x: tuple
    contact: tuple
    jets: tuple
    # the jets before what happened at the end of the step
    arrived: tuple
    length: Any
    # error of the step over the error allowed
    effort: Any
    # whether the lane moves on; if not: is the error small enough, are all numbers
    # finite, is Newton on the surface still settling, and what is a better length
    good: Any
    fits: Any
    finite: Any
    settling: Any
    shorter: Any
    guess: tuple
    stopped: Any
    lands: Any
    begins: Any
    released: Any
    fastest: Any
    # duration of the rest of the impacts, where they begin
    completion: Any
    drift: tuple


def advance_lane(plan: Plan, lane: Lane, attempt: Attempt) -> Lane:
    """The lane after an attempt."""
    active = lane.status == RUNNING
    good = attempt.good
    longest = _longest(plan, lane, attempt)
    trial = _next_length(plan, lane, attempt, longest)
    fixed = (good & attempt.begins) | (lane.completing & ~good)
    # steps too short to move the clock lead nowhere either
    moved = good & (attempt.t > lane.t)
    failures = jnp.where(moved | ~active, 0.0, lane.failures + 1.0)
    stop_gradient = jax.lax.stop_gradient
    waiting = active & any_of(lane.contact) & attempt.finite
    fastest = jnp.where(attempt.released, 0.0, attempt.fastest)
    return Lane(
        t=jnp.where(good, attempt.t, lane.t),
        x=select(good, attempt.x, select(waiting, attempt.guess, lane.x)),
        contact=select(good, attempt.contact, lane.contact),
        jets=tuple(
            Jet(*select(good, new, old))
            for new, old in zip(attempt.jets, lane.jets, strict=True)
        ),
        # the length of a completion is a physical time and keeps its derivative
        step=jnp.where(fixed, trial, stop_gradient(trial)),
        longest=stop_gradient(jnp.where(active, longest, lane.longest)),
        completing=jnp.where(good, attempt.begins, lane.completing),
        stops=lane.stops + jnp.where(attempt.stopped, 1.0, 0.0),
        fastest=stop_gradient(jnp.where(good, fastest, lane.fastest)),
        scale=tuple(
            stop_gradient(jnp.where(good, jnp.maximum(s, jnp.abs(j.gap)), s))
            for s, j in zip(lane.scale, attempt.jets, strict=True)
        ),
        drift=tuple(map(stop_gradient, select(good, attempt.drift, lane.drift))),
        failures=failures,
        status=_status(plan, lane, attempt, failures),
        steps=lane.steps + jnp.where(active, 1.0, 0.0),
        impacts=lane.impacts + jnp.where(good & attempt.lands, 1.0, 0.0),
        chatters=lane.chatters + jnp.where(good & attempt.begins, 1.0, 0.0),
    )


def _longest(plan, lane, attempt):
    """The longest step that the error allows; short steps say little about it."""
    h, effort = attempt.length, attempt.effort
    # single precision is plenty for choosing a step, and much cheaper
    rough = jnp.asarray(jnp.clip(effort, 1e-12, 1e12), dtype=jnp.float32)
    rough = jnp.exp2(jnp.log2(rough) * jnp.float32(-1.0 / plan.tableau.order))
    factor = jnp.clip(0.9 * jnp.asarray(rough, dtype=jnp.float64), 0.2, 6.0)
    factor = jnp.where(jnp.isfinite(effort), factor, 0.1)
    # a much shorter step says nothing about the longest
    grown = jnp.where(h < 0.5 * lane.longest, lane.longest, h * factor)
    grown = jnp.where(h < 0.999 * lane.longest, jnp.maximum(lane.longest, grown), grown)
    grown = jnp.where(any_of(lane.contact) & (effort == 0.0), lane.longest, grown)
    failed = jnp.where(attempt.fits, lane.longest, h * factor)
    longest = jnp.where(attempt.good, grown, failed)
    return jnp.minimum(jnp.minimum(longest, plan.longest_step), plan.t1 - lane.t + h)


def _next_length(plan, lane, attempt, longest):
    """To the next contact or release, if it is nearer than the error allows."""
    ahead = longest
    good, h = attempt.good, attempt.length
    # the step that completes a chatter did not follow the motion
    whole = (h > 0) & ~lane.completing
    inverse = jnp.where(whole, 1.0, 0.0) / jnp.where(whole, h, 1.0)
    for k, (jet, contact) in enumerate(zip(attempt.jets, attempt.contact, strict=True)):
        ends = lane.jets[k], attempt.arrived[k]
        flight = time_to_contact(jet, end_curvature(*ends, inverse))
        held = jnp.minimum(time_to_release(*ends, inverse), plan.longest_step)
        limit = jnp.where(contact, held, jnp.where(flight > 0, flight, jnp.inf))
        ahead = jnp.minimum(ahead, limit)
    again = jnp.where(attempt.fits, jnp.minimum(attempt.shorter, h), longest)
    again = jnp.where(attempt.settling, h, again)
    again = jnp.where(attempt.finite, again, 0.25 * h)
    trial = jnp.where(good, ahead, again)
    trial = jnp.where(good & attempt.begins, attempt.completion, trial)
    return jnp.where(lane.completing & ~good, lane.step, trial)


def _status(plan, lane, attempt, failures):
    bad = ~attempt.finite | ~jnp.isfinite(attempt.effort)
    reached = attempt.stopped & (attempt.t >= plan.t1)
    gave_up = jnp.where(bad, NOT_FINITE, STEP_FAILED)
    status = jnp.where(failures > _PATIENCE, gave_up, lane.status)
    status = jnp.where(reached, FINISHED, status)
    return jnp.where(lane.status == RUNNING, status, lane.status)
