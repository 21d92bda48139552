"""Update the loop state after an attempted step."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ..breakpoints import declared
from ..codes import (
    ACCUMULATES,
    FINISHED,
    NOT_FINITE,
    PAINLEVE,
    RUNNING,
    STEP_FAILED,
    TOGETHER,
)
from ..runge_kutta import Tableau, tableau_of
from ._functions import Functions
from ._gap_polynomial import Jet
from ._loop_state import LoopState
from ._scale import moved_extents
from ._select import any_of, select
from ._step_length import longest_step, next_length


# consecutive attempts without progress in time after which a run gives up
_PATIENCE = 80
# weight of an impact that loses energy when these attempts are counted: small, because
# bodies come to rest only after many such impacts
_IMPACT_WEIGHT = 1 / 16
# if a run gives up, impacts on two constraints within this fraction of the longest
# allowed step are reported as accumulating
_TOGETHER = 1e-3
# minimum number of steps per forcing period
_PARTS = 4
# minimum number of steps in a run if neither their errors nor a period limit them
_UNSEEN = 64


class Plan(NamedTuple):
    """The constants of a run; scalars, except for the tableau."""

    t0: Any
    t1: Any
    # the run also stops and records at t0 + k stop_period
    stop_period: Any
    # limits the step if the error estimate is uninformative: in contact, and at rest
    # without a force
    longest_step: Any
    # the same limit, but finite if there is neither a period nor a maximum step
    unseen_step: Any
    # inverse of the length of the run
    per_run: Any
    # times at which steps must end, and their period
    breaks: tuple
    repeat: Any
    tolerance: Any
    # absolute error allowed in each component; `None` if it follows from the scale of
    # the motion
    absolute: Any
    smallness: Any
    depth: Any
    tableau: Tableau
    # whether to omit the compiler passes that make the loop fast
    plain: bool
    # whether a step ends exactly at a release, which only derivatives need; otherwise,
    # the state there follows from a series over the short remaining time
    exact_release: bool

    @staticmethod
    def of(
        system,
        settings,
        t0,
        t1,
        *,
        period=None,
        stop_period=jnp.inf,
        differentiable=True,
    ) -> "Plan":
        """Return the plan of a run from `t0` to `t1`; `period` defaults to that of the
        system.
        """
        own = system.period
        period = own if period is None else period
        longest = jnp.inf if period is None else period / _PARTS
        if settings.max_step is not None:
            longest = jnp.minimum(longest, settings.max_step)
        whole = jax.lax.stop_gradient(t1 - t0)
        unknown = period is None and settings.max_step is None
        return Plan(
            t0=t0,
            t1=t1,
            stop_period=stop_period,
            longest_step=longest,
            unseen_step=whole / _UNSEEN if unknown else longest,
            per_run=jnp.where(whole > 0, 1.0, 0.0) / jnp.where(whole > 0, whole, 1.0),
            breaks=declared(system),
            repeat=jnp.inf if own is None else own,
            tolerance=settings.tolerance,
            absolute=_each(settings.absolute),
            smallness=settings.chatter_smallness,
            depth=settings.chatter_depth,
            tableau=tableau_of(settings.solver),
            plain=settings.plain,
            exact_release=differentiable,
        )


def _each(absolute) -> tuple | None:
    """Return the allowed absolute errors as scalars; a single one applies to all
    components.
    """
    if absolute is None:
        return None
    numbers = jnp.ravel(jnp.asarray(absolute, dtype=jnp.float64))
    return tuple(numbers[i] for i in range(numbers.shape[0]))


class Attempt(NamedTuple):
    """An attempted step: its end and the detected events."""

    t: Any
    x: tuple
    mode: tuple
    jets: tuple
    # the jets before the event at the end of the step
    arrived: tuple
    length: Any
    # error of the step relative to the allowed error
    effort: Any
    # change of each component in the step, whether accepted or not
    tried: tuple
    # whether the step is accepted; if not: whether its error is small enough, whether
    # all numbers are finite, whether Newton's method on the surface is still
    # converging, and a better length
    good: Any
    fits: Any
    finite: Any
    settling: Any
    shorter: Any
    guess: tuple
    stopped: Any
    lands: Any
    # which constraint was hit, or surface crossed
    hit: list
    # whether the Poincaré section is crossed, if the system has one
    points: tuple
    # whether a constraint is hit; whether the motion cannot leave the surface that it
    # has reached
    strikes: Any
    stuck: Any
    # whether, because of friction, a contact force does not exist or is not unique at
    # the end of the step
    jams: Any
    # as in `LoopState`
    stale: tuple
    # whether rounding hides a flight; whether an impact loses energy
    hidden: Any
    loses: Any
    begins: Any
    # whether a release is near, so that the step is repeated to end there
    locates: Any
    released: Any
    fastest: Any
    # length of the next step if it is a physical time: the time to the release, or the
    # duration of the remaining impacts
    fixed: Any
    blur: tuple
    held: tuple


def after_attempt(
    functions: Functions, plan: Plan, carried: LoopState, attempt: Attempt
) -> LoopState:
    """Return the loop state after an attempt."""
    active = carried.status == RUNNING
    good = attempt.good
    longest = longest_step(plan, carried, attempt)
    trial = next_length(functions, plan, carried, attempt, longest)
    fixed = (good & attempt.begins) | (carried.completing & ~good) | attempt.locates
    # steps too short to advance the time also count as no progress
    moved = good & (attempt.t > carried.t)
    failures = jnp.where(moved | ~active, 0.0, carried.failures + _weight(attempt))
    stop_gradient = jax.lax.stop_gradient
    waiting = active & any_of(carried.contact) & attempt.finite
    fastest = jnp.where(attempt.released, 0.0, attempt.fastest)
    struck, crowded = _struck(carried, attempt)
    return LoopState(
        t=jnp.where(good, attempt.t, carried.t),
        x=select(good, attempt.x, select(waiting, attempt.guess, carried.x)),
        mode=select(good, attempt.mode, carried.mode),
        jets=tuple(
            Jet(*select(good, new, old))
            for new, old in zip(attempt.jets, carried.jets, strict=True)
        ),
        # a length that is a physical time keeps its derivative
        step=jnp.where(fixed, trial, stop_gradient(trial)),
        longest=stop_gradient(jnp.where(active, longest, carried.longest)),
        completing=jnp.where(good, attempt.begins, carried.completing),
        locating=attempt.locates & active,
        stops=carried.stops + jnp.where(attempt.stopped, 1.0, 0.0),
        fastest=stop_gradient(jnp.where(good, fastest, carried.fastest)),
        scale=_scale(carried, attempt),
        blur=tuple(map(stop_gradient, select(good, attempt.blur, carried.blur))),
        held=tuple(map(stop_gradient, select(good, attempt.held, carried.held))),
        struck=struck,
        crowded=crowded,
        crossed=_crossed(carried, attempt),
        points=tuple(
            old + jnp.where(good & new, 1.0, 0.0)
            for old, new in zip(carried.points, attempt.points, strict=True)
        ),
        stale=select(good, attempt.stale, carried.stale),
        thrown=_thrown(carried, good),
        origin=carried.origin,
        extents=moved_extents(carried.extents, carried.origin, attempt),
        ramp=stop_gradient(jnp.where(good, 6.0 * carried.ramp, carried.ramp)),
        failures=failures,
        status=_status(plan, carried, attempt, failures, crowded),
        steps=carried.steps + jnp.where(active, 1.0, 0.0),
        impacts=carried.impacts + jnp.where(good & attempt.strikes, 1.0, 0.0),
        chatters=carried.chatters + jnp.where(good & attempt.begins, 1.0, 0.0),
    )


def _scale(carried, attempt) -> tuple:
    """Return the largest gaps, and the largest distances from surfaces, so far."""
    found = []
    for k, (s, jet) in enumerate(zip(carried.scale, attempt.jets, strict=True)):
        grows = attempt.good
        if carried.stale and k >= len(carried.held):
            # while the motion slides, the jet contains the distance from the end of
            # sliding instead
            slides = attempt.mode[len(carried.jets) + k - len(carried.held)]
            grows = grows & ~slides
        larger = jnp.maximum(s, jnp.abs(jet.gap))
        found.append(jax.lax.stop_gradient(jnp.where(grows, larger, s)))
    return tuple(found)


def _struck(carried, attempt):
    """Return the time of the last impact on each constraint, and the number of
    consecutive impacts whose flights are hidden by rounding.
    """
    if not carried.struck:
        return carried.struck, carried.crowded
    struck = tuple(
        jax.lax.stop_gradient(jnp.where(attempt.good & now, attempt.t, before))
        for now, before in zip(attempt.hit, carried.struck, strict=False)
    )
    (crowded,) = carried.crowded
    more = jnp.where(attempt.hidden, crowded + _weight(attempt), 0.0)
    return struck, (jnp.where(attempt.good & attempt.strikes, more, crowded),)


def _weight(attempt):
    """Return the number of attempts without progress that this attempt counts as."""
    if len(attempt.held) < 2:
        return 1.0
    return jnp.where(attempt.good & attempt.loses, _IMPACT_WEIGHT, 1.0)


def _thrown(carried, good):
    """Return the flags `thrown` of the loop state after an attempt."""
    if not carried.thrown:
        return carried.thrown
    now = tuple(carried.completing & behind for behind in carried.behind)
    return select(good, now, carried.thrown)


def _crossed(carried, attempt):
    """Return the time of the last crossing of a switching surface."""
    if not carried.crossed:
        return carried.crossed
    now = attempt.good & attempt.lands & ~attempt.strikes
    time = jnp.where(now, attempt.t, carried.crossed[0])
    return (jax.lax.stop_gradient(time),)


def _together(carried):
    """Return whether two constraints were hit within a negligible fraction of the
    longest allowed step.
    """
    room = _TOGETHER * carried.longest
    recent = [jnp.where(carried.t - t <= room, 1.0, 0.0) for t in carried.struck]
    return sum(recent) > 1


def _status(plan, carried, attempt, failures, crowded):
    bad = ~attempt.finite | ~jnp.isfinite(attempt.effort)
    reached = attempt.stopped & (attempt.t >= plan.t1)
    gave_up = jnp.where(bad, NOT_FINITE, STEP_FAILED)
    status = jnp.where(failures > _PATIENCE, gave_up, carried.status)
    if carried.struck:
        stuck = (failures > _PATIENCE) | (crowded[0] > _PATIENCE)
        status = jnp.where(stuck & ~bad & _together(carried), TOGETHER, status)
    if carried.crossed:
        room = _TOGETHER * carried.longest
        just = ~bad & (failures > _PATIENCE) & (carried.t - carried.crossed[0] <= room)
        stuck = attempt.good & attempt.stuck
        status = jnp.where(just | stuck, ACCUMULATES, status)
    status = jnp.where(attempt.jams, PAINLEVE, status)
    status = jnp.where(reached, FINISHED, status)
    return jnp.where(carried.status == RUNNING, status, carried.status)
