"""Check a step of free flight for events: accept it, shorten it, or end it at an
impact.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import jax.numpy as jnp

from ._gap_polynomial import (
    bernstein,
    crossing,
    Jet,
    lowest,
    lowest_point,
    power_coefficients,
    time_to_root,
)
from ._select import everywhere


# an impact within this fraction of the step from its end is computed by the Taylor
# series there, whose error is of fourth order
_CLOSE = 2e-3
# the gap must also be nearly a straight line there, so that its root is a short series
_STRAIGHT = 4e-3
# the gap polynomial is trusted if its error, relative to the largest gap, is below this
_TRUST = 0.02
# a motion that leaves the surface from rest does not return to it within this fraction
# of the longest step
_SHORT = 1e-3


class StepVerdict(NamedTuple):
    """The outcome of a step for one constraint, or the earliest event of several.

    `retake` tells whether the step must be repeated, with the new `length`; `lands`,
    whether it ends in an event, which occurs `offset` (s) after its end.
    """

    retake: Any
    length: Any
    lands: Any
    offset: Any
    constraint: Any


def no_event(h) -> StepVerdict:
    """Return the outcome of a step of length `h` without an event."""
    no = jnp.asarray(False)
    return StepVerdict(no, jnp.full_like(h, jnp.inf), no, 0.0 * h, 0.0 * h)


def judge(
    left: Jet,
    right: Jet,
    h,
    slack,
    rounding,
    scale,
    room,
    longest,
    calm: bool = False,
    held: bool = False,
    where: Callable = everywhere,
) -> StepVerdict:
    """Check the step of one free constraint for events.

    **Arguments:** the jets at both ends, the step length, the negative gap that is
    tolerated, the gap that rounding cannot distinguish from zero, the largest gap so
    far, the time left to the next requested time (an impact beyond it waits for a later
    step), and the longest step that the error allows. If `calm`, at a Poincaré section,
    a motion may stay at a distance that is tolerated; otherwise, rounding would make a
    motion at rest on the section cross it endlessly. `held` tells whether friction may
    hold a body at the constraint. `where` selects the results of parts that are rarely
    needed.
    """
    polynomial = bernstein(left, right, h)
    own = longest if held else None
    inward = moves_in(right, rounding, own)
    if calm:
        inward = inward & ((left.gap >= 0) | (right.gap < -slack))
    behind = (right.gap < -slack) | ((right.gap < 0) & inward)
    # on the surface at the start of the step and moving or pulled in: no time passes
    now = (left.gap <= 0) & moves_in(left, rounding, own) & (h == 0)
    # a polynomial whose error is comparable with the gap is uninformative; if the gap
    # has been closed so far, its value is itself only rounding
    size = jnp.maximum(scale, jnp.maximum(jnp.abs(left.gap), jnp.abs(right.gap)))
    # if the gap grows from rest as a power of time, shorter steps do not help
    leaves = (left.gap == 0) & (left.velocity == 0) & (h <= _SHORT * longest)
    leaves = leaves & (right.velocity > 0) & (right.acceleration > 0)
    vague = (polynomial.error > _TRUST * size + rounding) & ~now & ~leaves
    # a straight line decides whether the root is near, because the series may have a
    # small value far from the root
    distance = jnp.abs(right.gap)
    speed = jnp.abs(right.velocity)
    straight = distance * jnp.abs(right.acceleration) <= _STRAIGHT * speed * speed
    close = (distance <= _CLOSE * h * speed) & straight
    offset = jnp.where(close, time_to_root(right), 0.0)
    offset = jnp.where(now, 0.0, offset)
    near = (close | (distance <= rounding)) & (offset <= room)
    dips = (lowest(polynomial) < -slack) & ~behind & ~now & ~leaves
    lands = ((inward & near) | now) & ~dips & ~vague
    retake = (behind & ~lands) | dips | vague

    def shorter():
        c = power_coefficients(left, right, h)
        fraction = jnp.where(behind, crossing(c), lowest_point(polynomial, c))
        return jnp.where(vague, 0.5, fraction) * h

    length = where(retake, shorter, jnp.inf)
    return StepVerdict(retake, length, lands, offset, jnp.zeros_like(h))


def moves_in(jet: Jet, rounding, longest=None):
    """Return whether the motion enters, or is accelerated into, the constraint.

    If the parabola through the jet turns back before the penetration exceeds the
    rounding error, the motion only touches the constraint. Friction may hold a body at
    rest at a constraint, and the body leaves it under a force that grows from zero. If
    the `longest` step is given, the same therefore holds for a motion that the jerk
    turns back, or that is hidden by the rounding error during this step.
    """
    touches = (jet.acceleration > 0) & (
        2 * jet.acceleration * (jet.gap + rounding) > jet.velocity**2
    )
    falls = (jet.velocity < 0) & ~touches
    enters = falls | ((jet.velocity == 0) & (jet.acceleration < 0))
    if longest is None:
        return enters
    v, a, j = -jet.velocity, jnp.maximum(-jet.acceleration, 0.0), jet.jerk
    # distances due to the velocity alone, and due to the acceleration alone
    room = (jet.gap + rounding) / 8
    turned = (8 * v * v * v <= 9 * j * room * room) & (
        2 * a * a * a <= 3 * j * j * room
    )
    still = (v * longest <= room) & (a * longest * longest <= room)
    return enters & ~((room > 0) & ((turned & (j > 0)) | still))


def earliest(verdicts: list[StepVerdict]) -> StepVerdict:
    """Return the outcome of the step for all constraints, that is, its first event."""
    best = verdicts[0]
    for k, v in enumerate(verdicts[1:], start=1):
        sooner = v.lands & (~best.lands | (v.offset < best.offset))
        best = StepVerdict(
            best.retake | v.retake,
            jnp.minimum(best.length, v.length),
            best.lands | v.lands,
            jnp.where(sooner, v.offset, best.offset),
            jnp.where(sooner, float(k), best.constraint),
        )
    return best._replace(lands=best.lands & ~best.retake)
