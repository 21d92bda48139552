"""Change the mode at a switching surface: cross it, slide along it, or leave it."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._flight import moves_in, StepVerdict
from ._functions import Functions
from ._gap_polynomial import Jet
from ._loop_state import COMPLETED, LoopState
from ._select import any_of, select
from ._step import Step


# just after a crossing, a distance below this fraction of the largest one so far is an
# error of event location
_NEAR = 1e-9
# the share of sliding is that of a force at its limit to within this
_AT_LIMIT = 1e-9
# the scale of the distance from a surface is at least the distance that the motion
# covers in this fraction of the longest step
_SHORT = 1e-3
# an acceleration off a constraint below this fraction of the acceleration before the
# motion slid is a rounding error
_ZERO = 1e-11


class Sides(NamedTuple):
    """The flags of the switching surfaces after the event at the end of a step."""

    # as in `Functions`, one flag for each surface
    negative: tuple
    sliding: tuple
    # for each surface, whether sliding along it ends here
    leaves: list
    # for each surface, whether the state is on it, to within rounding
    near: list


class Passed(NamedTuple):
    """The jets after a crossing, and the flags of sliding that follow from them."""

    jets: list
    # for each surface, whether the motion slides along it from here
    slides: list
    # whether the motion can neither leave a surface nor slide along it
    stuck: Any
    # whether the completion of a chatter has moved the state past a surface on which
    # the motion should have stopped
    passed_over: Any


def jumped_across(carried: LoopState, verdicts: list[StepVerdict], h, stops):
    """Return the verdicts, changed so that a surface is crossed at once if a jump of
    the state has passed it, or if sliding begins there (`stops`).
    """
    m = len(carried.held)
    for k, behind in enumerate(carried.behind, start=m):
        now, seen = (behind | stops[k - m]) & (h == 0), verdicts[k]
        verdicts[k] = seen._replace(
            retake=seen.retake & ~now,
            length=jnp.where(now, jnp.inf, seen.length),
            lands=seen.lands | now,
            offset=jnp.where(now, 0.0, seen.offset),
        )
    return verdicts


def stopped_by_impacts(functions: Functions, carried: LoopState) -> list:
    """Return for each surface whether the motion slides along it as soon as contact
    begins, because the impacts of a completed chatter have stopped the slip.
    """
    flags = [jnp.asarray(False) for _ in range(functions.k)]
    if not (functions.m and functions.slidable):
        return flags
    now = (carried.stale[0] == COMPLETED) & any_of(carried.contact)
    for k in functions.slidable:
        near = jnp.abs(carried.jets[functions.m + k].gap) <= _near(carried, k)
        flags[k] = now & near & ~carried.sliding[k]
    pairs = zip(carried.sliding, flags, strict=True)
    trial = (*carried.mode[: len(carried.jets)], *(a | b for a, b in pairs))
    excess, _ = functions.hold(carried.t, carried.x, trial)
    return [flag & (off <= 0) for flag, off in zip(flags, excess, strict=True)]


def _near(carried: LoopState, k: int):
    """Return the distance from a surface up to which the state counts as on it."""
    row = len(carried.held) + k
    return _NEAR * _size(carried, k) + 4 * carried.blur[row]


def _size(carried: LoopState, k: int):
    """Return the largest distance from a surface so far, or the distance covered in a
    short step if that is larger.
    """
    row = len(carried.held) + k
    step = jnp.abs(carried.jets[row].velocity) * carried.longest
    return jnp.maximum(carried.scale[row], _SHORT * step)


def sides_after(
    functions: Functions, carried: LoopState, made: Step, hit, lands, t, x
) -> Sides:
    """Return the sides after a step to the time `t` and the state `x`.

    A crossing changes the side. Sliding ends on the side whose weight has reached one;
    or, after a jump of the state, on the side to which the state has jumped.
    """
    negative, sliding = list(carried.negative), list(carried.sliding)
    across = hit[functions.m :]
    if not functions.slidable:
        negative = functions.turned(negative, across)
        return Sides(tuple(negative), tuple(sliding), [], [])
    shares = functions.shares(t, made.raw, carried.mode)
    across = _leaving_together(functions, carried, shares, across)
    heights, blur = functions.heights(t, x, carried.extents, carried.mode)
    leaves = [jnp.asarray(False) for _ in negative]
    on, thrown, turns = list(leaves), list(leaves), list(across)
    for k in functions.slidable:
        crossed, slid = across[k], sliding[k]
        leaves[k] = crossed & slid
        turns[k] = crossed & jnp.where(slid, shares[k] > 0.5, True)
        near = _NEAR * _size(carried, k) + 500 * blur[k]
        on[k] = jnp.abs(heights[k]) <= near
        thrown[k] = lands & ~crossed & slid & ~on[k]
        sliding[k] = slid & ~leaves[k] & ~thrown[k]
    negative = functions.turned(negative, turns)
    for k in functions.slidable:
        negative[k] = jnp.where(thrown[k], heights[k] < 0, negative[k])
    return Sides(tuple(negative), tuple(sliding), leaves, on)


def _leaving_together(functions: Functions, carried: LoopState, shares, across):
    """Return the surfaces that are crossed, and those where sliding ends at the same
    time: friction holds the feet of a rigid body that lies flat up to the same limit.
    """
    if not functions.rubs or len(functions.slidable) < 2:
        return across
    slack = functions.slack(carried.mode)
    ends = any_of([across[k] & carried.sliding[k] for k in functions.slidable])
    found = list(across)
    for k in functions.slidable:
        left = (shares[k] + slack[k]) * (1 + slack[k] - shares[k])
        found[k] = found[k] | (ends & carried.sliding[k] & (left <= _AT_LIMIT))
    return found


def past_surfaces(
    functions: Functions,
    carried: LoopState,
    jets,
    hit,
    sides: Sides,
    approach,
    blur,
    stops,
) -> Passed:
    """Return the jets after the crossing of a surface, at zero distance from it.

    With a hysteresis, the distance is twice the hysteresis; after a reset, it may have
    any value. If the branch beyond the surface points back, the motion slides; the
    field then changes by at most 1 + s times the difference of the branches, where s is
    the result of `Functions.slack` for this surface. `approach` is the (negative) rate
    at which the motion reached the surface, `blur` the rounding errors of the
    distances, and `stops` the result of `stopped_by_impacts`.
    """
    jets, m = list(jets), functions.m
    slides, stuck = [], jnp.asarray(False)
    passed_over, over = stuck, carried.passed_over
    slack = functions.slack(carried.mode) if functions.slidable else ()
    passes = any_of(hit[m : m + functions.one_way])
    for k in range(functions.one_way):
        # a guard that is zero at the beginning of its mode
        gap = jets[m + k].gap
        zero = passes & (jnp.abs(gap) <= _near(carried, k))
        jets[m + k] = jets[m + k]._replace(gap=jnp.where(zero, 0.0, gap))
        slides.append(jnp.asarray(False))
    for k in range(functions.one_way, functions.k):
        jet, behind = jets[m + k], carried.behind[k]
        left = sides.leaves[k] if sides.leaves else jnp.asarray(False)
        crossed = hit[m + k] & ~left
        on = crossed & (jnp.abs(jet.gap) <= _near(carried, k))
        back = on & moves_in(jet._replace(gap=jnp.where(on, 0.0, jet.gap)), blur[m + k])
        gap = jnp.where(on | left, 0.0, jet.gap)
        if k not in functions.slidable:
            slides.append(jnp.asarray(False))
            # a Poincaré section cannot stop a motion
            if functions.counts is None or k + 1 < functions.k:
                stuck = stuck | back
            jets[m + k] = jet._replace(gap=gap)
            continue
        most = -approach * slack[k] / (1 + slack[k])
        summed = crossed & over[k]
        slides.append((on | summed) & ((jet.velocity <= most) | stops[k]))
        if functions.m:
            passed_over = passed_over | (slides[k] & summed)
            gap = jnp.where(slides[k], 0.0, gap)
        # at the limit of the friction force, the motion leaves with zero velocity
        smooth = left & ~behind & (slack[k] == 0)
        velocity = jnp.where(left, jnp.maximum(jet.velocity, 0.0), jet.velocity)
        jets[m + k] = Jet(
            gap,
            jnp.where(smooth, 0.0, velocity),
            jnp.where(smooth, jnp.maximum(jet.acceleration, 0.0), jet.acceleration),
            jet.jerk,
        )
    return Passed(jets, slides, stuck, passed_over)


def _seen_again(carried: LoopState, jets) -> LoopState:
    """Return a state whose mode has just changed, with the jets of its new mode.

    **Arguments:** the state, and the `jets` at the end of a step of length zero.
    """
    (change,) = carried.stale
    m, after = len(carried.held), list(carried.jets)
    for k, (old, new) in enumerate(zip(carried.jets, jets, strict=True)):
        if k < m:
            rest = (old.gap == 0) & (old.velocity == 0)
            tiny = jnp.abs(new.acceleration) <= _ZERO * jnp.abs(old.acceleration)
            acceleration = jnp.where(rest & tiny, 0.0, new.acceleration)
            fresh, least = Jet(old.gap, old.velocity, acceleration, new.jerk), 2.0
        else:
            # a distance that an event has made zero stays zero
            gap = jnp.where((old.gap == 0) & ~carried.sliding[k - m], 0.0, new.gap)
            fresh, least = new._replace(gap=gap), 1.0
        after[k] = Jet(*select(change >= least, fresh, old))
    return carried._replace(jets=tuple(after))


def refreshed(carried: LoopState, made: Step) -> tuple[LoopState, Step]:
    """Return a state whose mode has just changed, and its step, with updated jets."""
    carried = _seen_again(carried, made.jets)
    jets = of_constraints(carried, carried.jets, made.jets)
    return carried, made._replace(jets=jets)


def of_constraints(carried: LoopState, old, new) -> list:
    """Return the new jets, except that constraints keep the old ones after a step of
    length zero.

    Such a step only updates the jets of surfaces, because rounding must not undo a
    release.
    """
    again, m = carried.stale[0] > 0, len(carried.held)
    kept = zip(old[:m], new[:m], strict=True)
    return [*(Jet(*select(again, a, b)) for a, b in kept), *new[m:]]
