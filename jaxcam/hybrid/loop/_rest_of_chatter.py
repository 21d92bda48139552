"""Check whether the chatter after an impact may be completed, and compute its end."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ..surface import completion_time
from ._loop_state import closed
from ._select import of_constraint, select


class Rest(NamedTuple):
    """The completion of a chatter sequence, starting after an impact: whether it is
    possible, its duration (s), the state without normal velocity, and the normal
    acceleration of this state and its rate.
    """

    possible: Any
    duration: Any
    state: tuple
    acceleration: Any
    rate: Any


class Impact(NamedTuple):
    """An impact on one constraint, or on several; states are tuples of scalars."""

    t: Any
    before: tuple
    after: tuple
    # normal velocity before the impact (negative) and after it
    approach: Any
    rebound: Any
    constraint: Any
    # whether it is an impact on several constraints at once
    several: Any
    # whether the impact law for several constraints applies
    joins: Any


# margin of the test by the velocities of one impact: its ratio of velocities differs
# from the coefficient of restitution in the limit of slow impacts
_MARGIN = 1.5


def may_rest(plan, impact: Impact, jets, hides):
    """Return whether the chatter after an impact may be completed, by the velocities of
    this impact instead of the coefficient of restitution, which is above -1.

    **Arguments:** `hides` tells whether rounding hides the next flight, and thus the
    ratio of the velocities.
    """
    a = of_constraint([j.acceleration for j in jets], impact.constraint)
    j = of_constraint([j.jerk for j in jets], impact.constraint)
    approach = jnp.where(impact.approach < 0, -impact.approach, 1.0)
    # 1 - r, times the speed of approach
    lost = _MARGIN * (approach - impact.rebound)
    hides = hides | (impact.approach >= 0)
    lost = jnp.where(hides | (lost > 2 * approach), 2 * approach, lost)
    small = impact.rebound * jnp.abs(j) * approach <= plan.smallness * a * a * lost
    return (a < 0) & small & ~impact.several


def rest_of_chatter(
    functions, plan, impact: Impact, speeds, jets, mode, stop, rounding
) -> Rest:
    """Complete the chatter after an impact; return whether the completion is valid.

    **Arguments:** the normal `speeds` before the impact, the `jets` after it and the
    `mode` then, the time (s) of the next `stop` of the run, and the `rounding` of each
    gap and switching function.
    """
    t, before, after, approach, rebound, constraint, several, joins = impact
    m = functions.m
    ends = speeds[:m], [j.velocity for j in jets[:m]]
    parts = functions.chatter(t, (before, after), ends, mode)
    dampings, restitutions, states = parts
    damping = of_constraint(dampings, constraint)
    r0 = of_constraint(restitutions, constraint)
    state = states[0]
    for k in range(1, functions.m):
        state = select(constraint == k, states[k], state)
    if functions.rubs and functions.joins:
        # coefficient of restitution and state, if the impact law is that of all closed
        # gaps
        change = jnp.where(joins & (rebound > approach), rebound - approach, 1.0)
        ratio = rebound / jnp.where(joins & (approach < 0), -approach, 1.0)
        r0 = jnp.where(joins, ratio, r0)
        part = jnp.where(joins, rebound / change, 0.0)
        alone = [b + part * (a - b) for a, b in zip(before, after, strict=True)]
        state = select(joins, tuple(alone), state)
    a = of_constraint([j.acceleration for j in jets], constraint)
    j = of_constraint([j.jerk for j in jets], constraint)
    small = rebound * jnp.abs(j) <= plan.smallness * (1 - r0) * a * a
    # the formula applies only to impacts on one constraint
    possible = (a < 0) & small & (r0 < 1) & ~several
    # acceleration and rate at the state without normal velocity
    a = jnp.where(possible, a - damping * rebound, -1.0)
    rate = j - damping * a
    r0 = jnp.where(possible, r0, 0.0)
    incoming = jnp.where(approach < 0, -approach, 1.0)
    inverse = 1 / incoming
    softening = (rebound * inverse - r0) * inverse
    duration = completion_time(rebound, a, rate, damping, r0, softening)
    at_end = a + rate * duration
    soon = (t + duration <= stop) | (duration <= 1e-13 * jnp.abs(t))
    possible = possible & (a < 0) & (at_end < 0) & soon
    contact = closed(mode, functions.m, len(jets))
    jump = jnp.where(possible & (rebound > approach), rebound - approach, 1.0)
    for k, jet in enumerate(jets if len(jets) > 1 else ()):
        # no other gap may close in the meantime; over such a short time, a gap is a
        # parabola whose acceleration includes the mean force of the remaining impacts
        mean = jet.acceleration - a * (jet.velocity - speeds[k]) / jump
        strongest = jnp.minimum(jet.acceleration, mean)
        left = jet.gap + duration * (jet.velocity + duration * strongest / 2)
        clear = (constraint == k) | contact[k] | (left > 0)
        if k < functions.m:
            # also clear: a body that leaves the constraint, and still does at the end
            rises = jet.velocity + duration * strongest > 0
            clear = clear | (rises & (jet.gap >= -rounding[k]))
        else:
            # also clear: a slip that friction has stopped
            clear = clear | (jet.gap <= rounding[k])
        possible = possible & clear
    return Rest(possible, duration, state, a, rate)


def no_rest(impact: Impact) -> Rest:
    """Return the result for a system without constraints: no chatter follows."""
    zero = jnp.zeros_like(impact.t)
    return Rest(jnp.asarray(False), zero, impact.after, zero, zero)
