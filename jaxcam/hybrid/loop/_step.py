"""Take one attempted step: choose its end and integrate to it."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ..breakpoints import between, neighbours
from ..codes import RUNNING
from ..runge_kutta import rates_among, step
from ._advance import Plan
from ._flight import moves_in
from ._frame import Frame
from ._functions import Functions
from ._loop_state import LoopState
from ._scale import error_allowed, error_norm, held_scales, scales
from ._select import any_of


class StepEnd(NamedTuple):
    """The end of a step, and the times that limit it."""

    length: Any
    t: Any
    # time that must not be exceeded (s), a breakpoint or a requested time; and the next
    # requested time (s)
    stop: Any
    asked: Any
    # whether the step ends at `stop`, and the time from its end to `stop` otherwise
    at_stop: Any
    room: Any
    # the last breakpoint before the step, and the first after it
    sides: tuple


class Step(NamedTuple):
    """The quantities at the end of a completed step."""

    # the final state from Runge-Kutta, and its projection onto the contact surfaces
    raw: tuple
    x: tuple
    # the gaps and their derivatives, and the directions of this projection
    jets: list
    frame: Frame
    # first, second and third time derivatives of the state
    rates: tuple
    # error relative to the allowed error; scale of each component
    effort: Any
    scale: tuple


def end_of_step(
    functions: Functions, plan: Plan, carried: LoopState, rounding
) -> StepEnd:
    """Choose where the next step ends; `rounding` is the resolution of a gap."""
    asked = jnp.minimum(plan.t0 + (carried.stops + 1) * plan.stop_period, plan.t1)
    sides = neighbours(plan.breaks, plan.repeat, carried.t)
    stop = jnp.minimum(asked, sides[1])
    m, longest = len(carried.held), carried.longest if functions.slidable else None
    # on the surface and moving in, or in contact and pulled away: no time passes
    now = any_of(
        [
            jnp.where(
                c,
                j.acceleration > 0,
                (j.gap <= 0) & moves_in(j, near, longest if k < m else None),
            )
            for k, (j, c, near) in enumerate(
                zip(carried.jets, carried.closed, rounding, strict=True)
            )
        ]
    )
    if carried.crossed:
        # nor does time pass after a jump of the state across a switching surface
        now = now | any_of(carried.behind)
    if carried.stale:
        now = now | (carried.stale[0] > 0)
    wanted = jnp.where(now, 0.0, jax.lax.stop_gradient(carried.step))
    timed = carried.completing | carried.locating
    at_stop = (carried.t + wanted >= stop) & ~timed
    h = jnp.where(at_stop, stop - carried.t, jnp.where(timed, carried.step, wanted))
    h = jnp.where(carried.status == RUNNING, h, 0.0)
    t = jnp.where(at_stop, stop, carried.t + h)
    room = jnp.where(at_stop, 0.0, stop - t)
    return StepEnd(h, t, stop, asked, at_stop, room, sides)


def seen_from_inside(plan: Plan, end: StepEnd):
    """Return a function that moves times strictly between the adjacent breakpoints."""
    if not plan.breaks:
        return lambda t: t
    (low, high), span = end.sides, plan.t1 - plan.t0
    return lambda t: between(t, low, high, span)


def make_step(
    functions: Functions, plan: Plan, carried: LoopState, end: StepEnd
) -> Step:
    """Integrate the step to its `end`, in the current mode."""
    inside, h = seen_from_inside(plan, end), end.length
    x, error, pairs = _integrated(functions, plan, carried, inside, h)
    seen = inside(end.t)
    x, kicks = functions.settled(seen, x, carried.mode)
    frame = functions.frame(seen, x, carried.mode)
    scale = scales(carried.extents, carried.x, x, pairs, h, plan.per_run)
    if not functions.planar:
        pairs = functions.pairs(carried.t, carried.x, carried.mode)
        scale = held_scales(scale, carried, frame.push, kicks, pairs, h)
    allowed = error_allowed(scale, carried.x, x, plan.tolerance, plan.absolute)
    effort = error_norm(error, allowed)
    jets = functions.jets(seen, x, carried.mode)
    projected = functions.onto(frame, jets, x, carried.mode)
    # with surfaces, the rates at x are known from the jets, and differ very little from
    # those at the projection
    start = x if functions.k else projected
    rates = functions.taylor(seen, start, carried.mode)
    return Step(x, projected, jets, frame, rates, effort, scale)


def _integrated(functions: Functions, plan: Plan, carried: LoopState, inside, h):
    """Return the state after a step, the error estimate, and the components that are
    rates of change of others.

    The state of a planar system in contact is found algebraically, starting from the
    old state.
    """

    def field(t, x):
        return functions.field(inside(t), x, carried.mode)

    def integrate():
        return step(plan.tableau, field, carried.t, carried.x, h)

    if not functions.planar:
        x, error, stages = integrate()
        return x, error, rates_among(carried.x, stages[0])
    pairs = rates_among(carried.x, field(carried.t, carried.x))
    unmoved = carried.x, tuple(0.0 * a for a in carried.x)
    x, error = functions.where(
        ~any_of(carried.contact), lambda: integrate()[:2], unmoved
    )
    return x, error, pairs
