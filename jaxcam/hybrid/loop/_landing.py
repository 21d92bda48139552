"""Apply the impact at the end of a step, and complete the chatter that follows it."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._advance import Plan
from ._crossing import past_surfaces, sides_after
from ._flight import StepVerdict
from ._functions import Functions
from ._hits_together import hits_together
from ._loop_state import LoopState
from ._rest_of_chatter import Impact, may_rest, no_rest, Rest, rest_of_chatter
from ._rest_together import loses_energy, rest_together
from ._select import any_of, largest, of_constraint, select
from ._series import taylor
from ._step import seen_from_inside, Step, StepEnd
from ._stick_together import stick_together


# changes of the normal velocities by a joint impact that are below this fraction of the
# largest change are rounding errors
_JOINT = 1e-13


class Landing(NamedTuple):
    """The end of a step, with the impact there if it `lands` (ends in an impact)."""

    t: Any
    # the time at which functions are evaluated, moved off breakpoints
    seen: Any
    x: tuple
    mode: tuple
    jets: list
    # rounding errors of the gaps, and of the distances from surfaces
    blur: tuple
    # which constraints were hit, or which surface was crossed
    hit: list
    impact: Impact
    chatter: Rest
    # whether the chatter is completed from here, which gaps close then, and the
    # acceleration of each
    begins: Any
    closing: list
    pulls: list
    fastest: Any
    # whether rounding hides the next flight, or the previous one
    hidden: Any
    # whether the impact loses energy
    loses: Any
    # whether a constraint is hit, rather than a switching surface crossed
    strikes: Any
    # whether, from here on, the motion slides along the surface that it has reached,
    # whether it leaves one along which it slid, and whether it can do neither
    slides: Any
    leaves: Any
    stuck: Any


def land(
    functions: Functions,
    plan: Plan,
    carried: LoopState,
    end: StepEnd,
    made: Step,
    lands,
    flown: StepVerdict,
    rounding,
    stops,
) -> Landing:
    """Return the state after the impact if the step `lands`, otherwise at its end.

    **Arguments:** `stops` tells on which surfaces sliding begins at once.
    """
    no = jnp.asarray(False)
    offset = jnp.where(lands, flown.offset, 0.0)
    t = end.t + offset
    seen = seen_from_inside(plan, end)(t)
    no_hits = [no] * (functions.m + functions.k)
    speeds = [
        j.velocity + offset * (j.acceleration + offset * j.jerk / 2) for j in made.jets
    ]
    approach = of_constraint(speeds, flown.constraint)

    def reach() -> Reached:
        return _reached(functions, carried, made, lands, flown, offset, seen)

    reached = Reached(made.x, made.x, no, no, no_hits, made.x, carried.contact)
    if functions.k:
        reached = functions.where(lands, reach, reached)
        parts = seen, lands, reached, approach, rounding, stops
        after = _after_surfaces(functions, carried, made, *parts)
    else:
        # one branch contains the impact and the jets after it, because they share most
        # of their operations
        reached, jets, blur = functions.where(
            lands | any_of(carried.closed),
            lambda: _with_jets(functions, carried, seen, reach()),
            _with_jets(
                functions, carried, seen_from_inside(plan, end)(end.t), reached, made
            ),
        )
        after = After(reached.x, reached.mode, jets, blur, no, no, no)
    x, mode, jets, hit = after.x, after.mode, after.jets, reached.hit
    strikes = any_of(hit[: functions.m]) if functions.k else lands

    # decide whether the remaining impacts can be completed by a formula
    rebound = jnp.maximum(
        of_constraint([j.velocity for j in jets], flown.constraint), 0.0
    )
    higher = jnp.maximum(carried.fastest, rebound)
    fastest = jnp.where(strikes, higher, carried.fastest)
    impact = Impact(
        t=t,
        before=reached.before,
        after=reached.after,
        approach=approach,
        rebound=rebound,
        constraint=flown.constraint,
        several=reached.several,
        joins=reached.joins,
    )
    parts = carried, end, impact, speeds, jets, mode, hit, fastest, rounding
    ending = _ending(functions, plan, *parts)
    hidden = _hides(carried, impact, jets, rounding)
    return Landing(
        t=t,
        seen=seen,
        x=x,
        mode=mode,
        jets=jets,
        blur=after.blur,
        hit=hit,
        impact=impact,
        chatter=ending.chatter,
        begins=strikes & ending.begins,
        closing=[strikes & c for c in ending.closing],
        pulls=ending.pulls,
        fastest=fastest,
        hidden=hidden,
        loses=strikes & loses_energy(impact),
        strikes=strikes,
        slides=after.slides,
        leaves=after.leaves,
        stuck=after.stuck,
    )


class Reached(NamedTuple):
    """The end of a step, after the impact or the crossing there, if there is one."""

    # states before and after the impact; whether several constraints are hit, and
    # whether the impact law for several applies; which constraints are hit
    before: tuple
    after: tuple
    several: Any
    joins: Any
    hit: list
    # the state to continue with, and which constraints are in contact
    x: tuple
    mode: tuple


def _reached(functions: Functions, carried, made: Step, lands, flown, offset, t):
    """Return the end of a step at the time `t`, which is `offset` after its end."""
    before, after = _impact(functions, carried, made, flown.constraint, t, offset)
    number = functions.m + functions.k
    hit = [lands & (flown.constraint == k) for k in range(number)]
    several, joins, after, hit = hits_together(
        functions, carried, hit, made.jets, offset, t, before, after
    )
    x = select(lands, after, made.x)
    mode = _kept_contacts(functions, carried, lands, joins, t, before, x)
    return Reached(before, after, several, joins, hit, x, mode)


class After(NamedTuple):
    """What the motion continues with; see `Landing`."""

    x: tuple
    mode: tuple
    jets: list
    blur: tuple
    slides: Any
    leaves: Any
    stuck: Any


def _after_surfaces(
    functions: Functions,
    carried: LoopState,
    made: Step,
    t,
    lands,
    reached: Reached,
    approach,
    rounding,
    stops,
) -> After:
    """Return what the motion continues with if there are switching surfaces."""
    number, hit, x = functions.m + functions.k, reached.hit, reached.x
    sides = sides_after(functions, carried, made, hit, lands, t, x)
    mode = reached.mode + sides.negative + sides.sliding
    changed = lands | any_of([*carried.closed, *(s > 0 for s in carried.stale)])
    jets = functions.where(changed, lambda: functions.jets(t, x, mode), made.jets)
    passed = past_surfaces(
        functions, carried, jets, hit, sides, approach, rounding, stops
    )
    joined = stick_together(functions, carried, hit, sides, mode, t, x)
    slides = [a | b for a, b in zip(passed.slides, joined.slides, strict=True)]
    flags = zip(mode[number:], slides, strict=True)
    mode = mode[:number] + tuple(a | b for a, b in flags)
    if functions.m and functions.slidable:
        moved, _ = functions.settled(t, x, mode)
        x = select(passed.passed_over | joined.passed_over, moved, x)
    blur = functions.blur(t, x, carried.extents, mode)
    flags = any_of(slides), any_of(sides.leaves), passed.stuck
    return After(x, mode, passed.jets, blur, *flags)


def _with_jets(functions: Functions, carried, t, reached: Reached, made=None):
    """Return the end of a step together with its jets and the rounding errors of the
    gaps; the jets are those of the step `made`, if that is given.
    """
    at = t, reached.x, reached.mode
    jets = functions.jets(*at) if made is None else made.jets
    blur = functions.blur(t, reached.x, carried.extents, reached.mode)
    return reached, jets, blur


def _impact(functions: Functions, carried, made: Step, constraint, t, offset):
    """Return the states before and after the impact, or crossing, at the end of a
    step.
    """
    before = taylor(made.x, made.rates, offset)
    after_each = functions.impact(t, before, carried.mode)
    for k in functions.slidable:
        # the end of sliding is not a crossing
        row = functions.m + k
        after_each[row] = select(carried.sliding[k], before, after_each[row])
    after = after_each[0]
    for k in range(1, len(after_each)):
        after = select(constraint == k, after_each[k], after)
    return before, after


class _Ending(NamedTuple):
    """Whether and how the impacts after this one are completed: see `Landing`."""

    chatter: Rest
    begins: Any
    closing: list
    pulls: list


def _ending(
    functions, plan, carried, end, impact, speeds, jets, mode, hit, fastest, rounding
) -> _Ending:
    """Complete the impacts that follow this one, on its constraint or on several."""
    if not functions.m:
        return _Ending(no_rest(impact), jnp.asarray(False), [], [])
    # the sequence must be advanced enough, or the rebound so slow that rounding hides
    # the next flight, whose height v^2 / 2a is then below 250 times the rounding error
    deep = impact.rebound <= plan.depth * fastest
    low = 500 * of_constraint(carried.blur, impact.constraint)
    hides = impact.rebound * impact.rebound <= low * _pull(jets, impact)
    ends = any_of(hit[: functions.m]) & (deep | hides)
    chatter = functions.where(
        ends & may_rest(plan, impact, jets, hides),
        lambda: rest_of_chatter(
            functions, plan, impact, speeds, jets, mode, end.stop, rounding
        ),
        no_rest(impact),
    )
    begins = chatter.possible & ends
    closing = [begins & h for h in hit[: functions.m]]
    pulls = [chatter.acceleration] * functions.m
    if functions.m == 1:
        return _Ending(chatter, begins, closing, pulls)
    natural = jnp.minimum(carried.longest, plan.longest_step)
    joint = rest_together(
        functions, impact, jets, mode, hit, natural, fastest, rounding
    )
    both = joint.possible
    closing = [a | (both & b) for a, b in zip(closing, joint.closing, strict=True)]
    chatter = chatter._replace(
        duration=jnp.where(both, 0.0, chatter.duration),
        state=select(both, joint.state, chatter.state),
        rate=jnp.where(both, 0.0, chatter.rate),
    )
    pulls = list(select(both, joint.multipliers, pulls))
    return _Ending(chatter, begins | both, closing, pulls)


def _kept_contacts(functions, carried, lands, joins, t, before, after):
    """Return the contacts that remain after an impact, which may break other contacts.

    A contact breaks if the impact changes its normal velocity by more than rounding; if
    it took part in the impact, rounding is relative to the largest change.
    """
    mode = carried.mode
    if functions.m <= 1:
        return carried.contact

    def kept():
        speeds = functions.velocity(t, before, mode), functions.velocity(t, after, mode)
        rounding = [functions.speed_blur(t, x, mode) for x in (before, after)]
        changes = [jnp.abs(new - old) for old, new in zip(*speeds, strict=True)]
        least = jnp.zeros(())
        if functions.rubs:
            least = jnp.where(joins, _JOINT * largest(changes), 0.0)
        return tuple(
            c & (change <= jnp.maximum(500 * (a + b), least))
            for c, change, a, b in zip(carried.contact, changes, *rounding, strict=True)
        )

    return functions.where(lands & any_of(carried.contact), kept, carried.contact)


def _pull(jets, impact):
    """Return the magnitude of the acceleration of the gap that has closed."""
    return jnp.abs(of_constraint([j.acceleration for j in jets], impact.constraint))


def _hides(carried, impact, jets, roundings):
    """Return whether the flight after or before an impact is lost in rounding.

    The height of the flight after the impact is v^2 / 2a. Without an acceleration
    towards the constraint, the height of the flight before the impact was at most the
    final speed of that flight times its duration.
    """
    rounding = of_constraint(roundings, impact.constraint)
    pulled = _pull(jets, impact)
    after = impact.rebound * impact.rebound <= 500 * rounding * pulled
    if not carried.struck:
        return after
    since = impact.t - of_constraint(carried.struck, impact.constraint)
    return after | (-impact.approach * since <= 500 * rounding)
