"""Check a step in contact: contact continues, or the constraint releases."""

import jax.numpy as jnp

from ._flight import StepVerdict
from ._gap_polynomial import end_curvature, Jet


# to locate a release, the step is repeated until its end is this close to the release,
# as a fraction of the step length that the error estimate alone allows; over the
# remaining time, the multiplier is a parabola
CLOSE = 1e-7


def judge_contact(
    left: Jet, right: Jet, h, scale, rounding, room, completing, locating
) -> StepVerdict:
    """Check the step of one constraint in contact.

    The multiplier (the acceleration a that contact suppresses) is negative while the
    contact is under compression. Within the step, it is the cubic through the values
    and rates at both ends, trusted to within the error of the trapezoidal rule. `scale`
    is the step length that errors alone would allow, and `rounding` the gap that cannot
    be distinguished from zero. If `completing`, the step ends at an accumulation point;
    if `locating`, it ends at a release known to be near.
    """
    a0, a1 = left.acceleration, right.acceleration
    s0, s1 = h * left.jerk, h * right.jerk
    trust = jnp.abs(a1 - a0 - (s0 + s1) / 2)
    # tension too weak to open a gap within the step is ignored
    first = a0 + s0 * (1 / 3)
    highest = jnp.maximum(first, a1 - s1 * (1 / 3)) + trust
    inside = (highest > 0) & (highest * h * h > rounding)
    rises = right.jerk > 0
    pulls = opens(right, scale, rounding)
    passed = (a1 > 0) & pulls
    slope = jnp.where(rises, right.jerk, 1.0)
    straight = -a1 / slope
    inverse = jnp.where(h > 0, 1.0, 0.0) / jnp.where(h > 0, h, 1.0)
    curvature = end_curvature(left, right, inverse)
    bend = straight * curvature / (2 * slope)
    # the remaining time is so short that the first correction is enough
    offset = straight * (1 - jnp.where(jnp.abs(bend) < 0.01, bend, 0.0))
    near = rises & pulls & (jnp.abs(offset) <= CLOSE * scale)
    # the zero of a multiplier whose rates also vanish there can only be bracketed
    enclosed = passed & (h <= CLOSE * scale)
    # whether the multiplier only touches zero, so that no flight would exceed rounding:
    # its rate decreases by at least half, which rounding cannot cause in a short step
    falls = (left.jerk > 0) & (2 * right.jerk <= left.jerk) & (h > 0)
    curved = jnp.where(falls, (left.jerk - right.jerk) * inverse, 1.0)
    peak = a1 + right.jerk**2 / (2 * curved)
    touches = falls & (8 * peak**2 <= rounding * curved)
    # a multiplier that keeps rising after an inflection releases
    touches = touches & ~(passed & (curvature > 0) & (a1 * h * h > rounding))
    # the constraint may have released before the zero at the end of the step
    early = (a0 < 0) & (first > 0)
    lets_go = near & (locating | (~touches & ~early & (offset <= room)))
    lets_go = (lets_go | (enclosed & ~touches)) & ~completing
    # a step that may have released before its end is halved
    suspect = inside & ~passed & ((a0 < 0) | (s0 > 0))
    retake = (passed | suspect) & ~lets_go & ~touches & ~completing
    share = jnp.where(passed, _root(a0, s0, a1, s1), 0.5)
    share = jnp.where(early, jnp.minimum(share, 0.5), share)
    length = jnp.where(retake, h * share, jnp.inf)
    offset = jnp.where(near & (h > 0), offset, 0.0)
    return StepVerdict(retake, length, lets_go, offset, jnp.zeros_like(h))


def opens(jet: Jet, scale, rounding):
    """Return whether the extrapolated multiplier opens a gap within the step length
    `scale` (s). A multiplier that is zero to within rounding does not.
    """
    rise = jnp.maximum(jet.jerk, 0.0)
    pull = jnp.maximum(jet.acceleration, 0.0) + rise * (scale / 3)
    return pull * scale * scale > 2 * rounding


def lets_go_before(jet: Jet, offset, scale, rounding):
    """Return whether a multiplier rises through zero before the impact `offset` (s)
    later.
    """
    at_impact = jet.acceleration + offset * jet.jerk
    return (jet.jerk > 0) & (at_impact > 0) & opens(jet, scale, rounding)


def _root(a0, s0, a1, s1):
    """Return where in (0, 1) the cubic rises through zero, by Newton's method starting
    from the chord.
    """
    rise = a1 - a0
    c2 = 3 * rise - 2 * s0 - s1
    c3 = s0 + s1 - 2 * rise
    s = -a0 / jnp.where(rise == 0, 1.0, rise)
    for _ in range(2):
        value = a0 + s * (s0 + s * (c2 + s * c3))
        slope = s0 + s * (2 * c2 + 3 * s * c3)
        s = jnp.clip(s - value / jnp.where(slope > 0, slope, jnp.inf), 0.02, 1.0)
    # starting where the cubic is flat, Newton's method may leave the step
    return jnp.where(s < 1.0, s, 0.5)
