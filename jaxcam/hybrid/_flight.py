"""Judging a step of free flight: accept it, retake it shorter, or land."""

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


# a landing is taken over by the Taylor series from this fraction of the step on: the
# series then errs by its fourth power
_CLOSE = 1e-3
# and the gap is nearly a straight line there, so that its root is a short series
_STRAIGHT = 4e-3


class Verdict(NamedTuple):
    """What became of a step; for one constraint, or the earliest of several."""

    retake: Any
    length: Any
    lands: Any
    offset: Any
    constraint: Any


def judge(left: Jet, right: Jet, h, slack, rounding, at_stop) -> Verdict:
    """Judge the step of one free constraint.

    **Arguments:** the jets at both ends, the length of the step, the gap below zero
    that is let pass, the gap that cannot be told from zero, and whether the step ends
    at a time that was asked for (an impact just behind it waits for the next step).
    """
    polynomial = bernstein(left, right, h)
    behind = (right.gap < -slack) | ((right.gap < 0) & (right.velocity < 0))
    # on the surface and moving in at the very start: no time passes
    now = (left.gap <= 0) & (left.velocity < 0) & (h == 0)
    offset = jnp.where(now, 0.0, time_to_root(right))
    near = (jnp.abs(offset) <= _CLOSE * h) & (
        jnp.abs(offset * right.acceleration) <= _STRAIGHT * jnp.abs(right.velocity)
    )
    near = near | (jnp.abs(right.gap) <= rounding)
    lands = ((right.velocity < 0) & near & ~(at_stop & (offset > 0))) | now
    dips = (lowest(polynomial) < -slack) & ~behind & ~now
    lands = lands & ~dips
    retake = (behind & ~lands) | dips
    c = power_coefficients(left, right, h)
    fraction = jnp.where(behind, crossing(c), lowest_point(polynomial, c))
    length = jnp.where(retake, fraction * h, jnp.inf)
    return Verdict(retake, length, lands, offset, jnp.zeros_like(h))


def earliest(verdicts: list[Verdict]) -> Verdict:
    """The verdict on the step as a whole: the first thing that happens in it."""
    best = verdicts[0]
    for k, v in enumerate(verdicts[1:], start=1):
        sooner = v.lands & (~best.lands | (v.offset < best.offset))
        best = Verdict(
            best.retake | v.retake,
            jnp.minimum(best.length, v.length),
            best.lands | v.lands,
            jnp.where(sooner, v.offset, best.offset),
            jnp.where(sooner, float(k), best.constraint),
        )
    return best._replace(lands=best.lands & ~best.retake)
