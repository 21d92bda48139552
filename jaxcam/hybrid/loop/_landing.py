"""Apply the impact at the end of a step, and decide whether to complete its chatter."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._advance import Plan
from ._flight import StepVerdict
from ._functions import Functions
from ._loop_state import LoopState
from ._rest_of_chatter import Impact, Rest, rest_of_chatter
from ._select import of_constraint, select
from ._series import taylor
from ._step import seen_from_inside, Step, StepEnd


class Landing(NamedTuple):
    """The end of a step, with the impact there if it lands."""

    t: Any
    # the time at which functions are evaluated
    seen: Any
    x: tuple
    contact: tuple
    jets: list
    # which constraint was hit
    hit: list
    impact: Impact
    chatter: Rest
    # whether the chatter is completed from here
    begins: Any
    fastest: Any
    # whether rounding hides the next flight, or the previous one
    hidden: Any


def land(
    functions: Functions,
    plan: Plan,
    carried: LoopState,
    end: StepEnd,
    made: Step,
    lands,
    flown: StepVerdict,
    rounding,
) -> Landing:
    """Return the state after the impact if the step `lands`, otherwise at its end."""
    offset = jnp.where(lands, flown.offset, 0.0)
    landed = taylor(made.x, made.rates, offset)
    t = end.t + offset
    seen = seen_from_inside(plan, end)(t)
    after_each = functions.impact(seen, landed)
    after = after_each[0]
    for k in range(1, functions.m):
        after = select(flown.constraint == k, after_each[k], after)
    approach = of_constraint(
        [
            j.velocity + offset * (j.acceleration + offset * j.jerk / 2)
            for j in made.jets
        ],
        flown.constraint,
    )
    x = select(lands, after, made.x)
    contact = _kept_contacts(functions, carried, lands, seen, landed, x)
    jets = functions.jets(seen, x, contact)

    # do the remaining impacts take negligible time?
    hit = [lands & (flown.constraint == k) for k in range(functions.m)]
    rebound = jnp.maximum(
        of_constraint([j.velocity for j in jets], flown.constraint), 0.0
    )
    fastest = jnp.where(lands, jnp.maximum(carried.fastest, rebound), carried.fastest)
    impact = Impact(t, landed, after, approach, rebound, flown.constraint)
    chatter = rest_of_chatter(functions, plan, impact, jets, contact, end.stop)
    # far enough into the sequence, or so low that rounding hides the next flight
    pulled = jnp.abs(of_constraint([j.acceleration for j in jets], flown.constraint))
    deep = rebound <= plan.depth * fastest
    # the height of a flight is v^2 / 2a; below 250 times the rounding, it is hidden
    low = 500 * of_constraint(carried.blur, flown.constraint)
    begins = lands & chatter.possible & (deep | (rebound * rebound <= low * pulled))
    hidden = _hides(
        carried, t, impact, pulled, of_constraint(rounding, flown.constraint)
    )
    return Landing(
        t, seen, x, contact, jets, hit, impact, chatter, begins, fastest, hidden
    )


def _kept_contacts(functions, carried, lands, t, before, after):
    """Return the contacts kept after an impact, which may break contact elsewhere.

    A contact breaks if the impact changes its normal velocity by more than rounding.
    """
    if functions.m == 1:
        return carried.contact
    speeds = functions.velocity(t, before), functions.velocity(t, after)
    rounding = functions.speed_blur(t, before), functions.speed_blur(t, after)
    return tuple(
        c & (~lands | (jnp.abs(new - old) <= 500 * (a + b)))
        for c, old, new, a, b in zip(carried.contact, *speeds, *rounding, strict=True)
    )


def _hides(carried, t, impact, pulled, rounding):
    """Return whether the flight after or before an impact is lost in rounding.

    The height of the flight after it is v^2 / 2a; without an acceleration towards the
    constraint, the height of the flight before it was at most its final speed times its
    duration.
    """
    after = impact.rebound * impact.rebound <= 500 * rounding * pulled
    if not carried.struck:
        return after
    since = t - of_constraint(carried.struck, impact.constraint)
    return after | (-impact.approach * since <= 500 * rounding)
