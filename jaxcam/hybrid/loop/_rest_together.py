"""Complete impacts that accumulate on several constraints at once.

Such a sequence has no closed form: the order of the impacts may never repeat. The
impacts are followed until the flights between them are negligible; then, the gaps
of all these constraints close.
"""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ..surface import LOSSY_RATIO, SHORT_FLIGHT, SLOW_REBOUND
from ._functions import Functions
from ._rest_of_chatter import Impact
from ._select import any_of, largest


class JointRest(NamedTuple):
    """The end of impacts that accumulate on several constraints."""

    possible: Any
    state: tuple
    # which gaps close; multiplier of each constraint
    closing: list
    multipliers: tuple


def rest_together(
    functions: Functions, impact: Impact, jets, mode, hit, natural, fastest, rounding
) -> JointRest:
    """Return the end of the impacts after this one on several constraints, and whether
    these impacts are negligible.

    **Arguments:** the `jets` after the impact, the `mode` then, which constraint was
    `hit`, the longest allowed step (s), the `fastest` rebound so far, and the
    `rounding` of each gap.
    """
    m = functions.m
    small = (SHORT_FLIGHT * natural) ** 2, (SLOW_REBOUND * fastest) ** 2
    strongest = largest([jnp.abs(jet.acceleration) for jet in jets[:m]])
    near = [~mode[k] & _ends(jets[k], strongest, *small, rounding[k]) for k in range(m)]
    closing = [hit[k] | near[k] for k in range(m)]
    touching = tuple(closing[k] | mode[k] for k in range(m))
    several = sum(jnp.where(closes, 1.0, 0.0) for closes in closing) > 1
    possible = any_of(hit[:m]) & loses_energy(impact) & several
    state, multipliers = functions.where(
        possible,
        lambda: functions.joint_rest(impact.t, impact.after, touching, mode),
        (impact.after, (0.0,) * m),
    )
    for k in range(m):
        pull = -multipliers[k]
        possible = possible & (~touching[k] | (pull >= 0))
        ends = _ends(jets[k], pull, *small, rounding[k])
        possible = possible & (~closing[k] | ends)
    return JointRest(possible, state, closing, multipliers)


def loses_energy(impact: Impact):
    """Return whether the rebound is slower than the approach."""
    return impact.rebound < -LOSSY_RATIO * impact.approach


def _ends(jet, pull, short, slow, rounding):
    """Return whether a gap remains closed, apart from negligible flights.

    **Arguments:** the acceleration `pull` (positive) towards the constraint, and the
    squares of a negligible time and of a negligible velocity.
    """
    height = jnp.maximum(short * pull, 50 * rounding)
    low = jet.velocity * jet.velocity <= jnp.maximum(height * pull, slow)
    return low & (jnp.abs(jet.gap) <= height)
