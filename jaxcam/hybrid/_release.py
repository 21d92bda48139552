"""Judging a step of contact: it goes on, or the constraint lets go."""

import jax.numpy as jnp

from ._flight import Verdict
from ._gap_polynomial import end_curvature, Jet


# a release is located by retaking the step until this fraction of a natural step
# remains, over which the multiplier is a parabola
_CLOSE = 1e-7


def judge_contact(
    left: Jet, right: Jet, h, scale, rounding, room, completing
) -> Verdict:
    """Judge the step of one constraint in contact.

    The multiplier (the acceleration a that contact suppresses) is negative while the
    constraint presses. Inside the step it is the cubic through values and rates at
    both ends, trusted up to what the trapezoidal rule misses. `scale` is the length of
    a step that errors alone would allow, `rounding` the gap that cannot be told from
    zero.
    """
    a0, a1 = left.acceleration, right.acceleration
    s0, s1 = h * left.jerk, h * right.jerk
    trust = jnp.abs(a1 - a0 - (s0 + s1) / 2)
    inside = jnp.maximum(a0 + s0 * (1 / 3), a1 - s1 * (1 / 3)) + trust > 0
    passed = a1 > 0
    rises = right.jerk > 0
    slope = jnp.where(rises, right.jerk, 1.0)
    straight = -a1 / slope
    inverse = jnp.where(h > 0, 1.0, 0.0) / jnp.where(h > 0, h, 1.0)
    bend = straight * end_curvature(left, right, inverse) / (2 * slope)
    # so small over the short time left that the first correction is enough
    offset = straight * (1 - jnp.where(jnp.abs(bend) < 0.01, bend, 0.0))
    now = passed & (h == 0)
    near = rises & (jnp.abs(offset) <= _CLOSE * scale)
    # a multiplier that only touches zero: no hop would come out of rounding. Its rate
    # falls by a half at least, which rounding cannot make it do over a short step
    falls = (left.jerk > 0) & (2 * right.jerk <= left.jerk) & (h > 0)
    curved = jnp.where(falls, (left.jerk - right.jerk) * inverse, 1.0)
    peak = a1 + right.jerk**2 / (2 * curved)
    touches = falls & (8 * peak**2 <= rounding * curved)
    lets_go = ((near & ~touches & (offset <= room)) | now) & ~completing
    # short of its end a step that only might have let go is halved
    suspect = inside & ~passed & (left.acceleration < 0)
    retake = (passed | suspect) & ~lets_go & ~touches & ~completing
    length = jnp.where(
        retake, h * jnp.where(passed, _root(a0, s0, a1, s1), 0.5), jnp.inf
    )
    return Verdict(
        retake, length, lets_go, jnp.where(now, 0.0, offset), jnp.zeros_like(h)
    )


def _root(a0, s0, a1, s1):
    """Where in (0, 1) the cubic rises through zero; from the chord, by Newton."""
    rise = a1 - a0
    c2 = 3 * rise - 2 * s0 - s1
    c3 = s0 + s1 - 2 * rise
    s = -a0 / jnp.where(rise == 0, 1.0, rise)
    for _ in range(2):
        value = a0 + s * (s0 + s * (c2 + s * c3))
        slope = s0 + s * (2 * c2 + 3 * s * c3)
        s = jnp.clip(s - value / jnp.where(slope > 0, slope, jnp.inf), 0.02, 1.0)
    return s
