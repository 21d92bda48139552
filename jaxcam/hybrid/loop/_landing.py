"""Apply the impact at the end of a step, and decide whether to complete its chatter."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._advance import Plan
from ._flight import moves_in, StepVerdict
from ._functions import Functions
from ._loop_state import LoopState
from ._rest_of_chatter import Impact, no_rest, Rest, rest_of_chatter
from ._select import any_of, of_constraint, select
from ._series import taylor
from ._step import seen_from_inside, Step, StepEnd


# distance after a crossing, over the largest so far, that is the error of its location
_NEAR = 1e-9


class Landing(NamedTuple):
    """The end of a step, with the impact there if it lands."""

    t: Any
    # the time at which functions are evaluated
    seen: Any
    x: tuple
    mode: tuple
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
    # whether a constraint is hit, not a switching surface crossed
    strikes: Any
    # whether the motion cannot leave the surface that it has reached
    slides: Any


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
    after_each = functions.impact(seen, landed, carried.mode)
    after = after_each[0]
    for k in range(1, len(after_each)):
        after = select(flown.constraint == k, after_each[k], after)
    approach = of_constraint(
        [
            j.velocity + offset * (j.acceleration + offset * j.jerk / 2)
            for j in made.jets
        ],
        flown.constraint,
    )
    x = select(lands, after, made.x)
    mode = _kept_contacts(functions, carried, lands, seen, landed, x)
    mode = mode + tuple(
        carried.mode[k] ^ (lands & (flown.constraint == k))
        for k in range(functions.m, functions.m + functions.k)
    )
    jets = functions.jets(seen, x, mode)
    hit = [lands & (flown.constraint == k) for k in range(len(jets))]
    strikes, slides = lands, False
    if functions.k:
        strikes = any_of(hit[: functions.m])
        jets, slides = _past_surfaces(functions, carried, jets, hit, rounding)

    # do the remaining impacts take negligible time?
    rebound = jnp.maximum(
        of_constraint([j.velocity for j in jets], flown.constraint), 0.0
    )
    higher = jnp.maximum(carried.fastest, rebound)
    fastest = jnp.where(strikes, higher, carried.fastest)
    impact = Impact(t, landed, after, approach, rebound, flown.constraint)
    if functions.m:
        chatter = rest_of_chatter(functions, plan, impact, jets, mode, end.stop)
    else:
        chatter = no_rest(impact)
    # far enough into the sequence, or so low that rounding hides the next flight
    pulled = jnp.abs(of_constraint([j.acceleration for j in jets], flown.constraint))
    deep = rebound <= plan.depth * fastest
    # the height of a flight is v^2 / 2a; below 250 times the rounding, it is hidden
    low = 500 * of_constraint(carried.blur, flown.constraint)
    begins = strikes & chatter.possible & (deep | (rebound * rebound <= low * pulled))
    hidden = _hides(
        carried, t, impact, pulled, of_constraint(rounding, flown.constraint)
    )
    return Landing(
        t,
        seen,
        x,
        mode,
        jets,
        hit,
        impact,
        chatter,
        begins,
        fastest,
        hidden,
        strikes,
        slides,
    )


def _kept_contacts(functions, carried, lands, t, before, after):
    """Return the contacts kept after an impact, which may break contact elsewhere.

    A contact breaks if the impact changes its normal velocity by more than rounding.
    """
    mode = carried.mode
    if functions.m <= 1:
        return carried.contact
    speeds = functions.velocity(t, before, mode), functions.velocity(t, after, mode)
    rounding = [functions.speed_blur(t, x, mode) for x in (before, after)]
    return tuple(
        c & (~lands | (jnp.abs(new - old) <= 500 * (a + b)))
        for c, old, new, a, b in zip(carried.contact, *speeds, *rounding, strict=True)
    )


def _past_surfaces(functions, carried, jets, hit, rounding):
    """Return the jets after the crossing of a surface, whose distance is then zero.

    With a hysteresis it is twice that, and after a reset any. Also returned is whether
    the motion is driven back, so that it would slide.
    """
    jets, slides = list(jets), []
    for k in range(functions.m, len(jets)):
        near = _NEAR * carried.scale[k] + 4 * carried.blur[k]
        on = hit[k] & (jnp.abs(jets[k].gap) <= near)
        jets[k] = jets[k]._replace(gap=jnp.where(on, 0.0, jets[k].gap))
        slides.append(on & moves_in(jets[k], rounding[k]))
    return jets, any_of(slides)


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
