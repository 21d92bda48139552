"""Choose the length of the next step after an attempted one."""

import functools

import jax.numpy as jnp

from ._gap_polynomial import end_curvature, Jet, time_to_contact, time_to_release
from ._loop_state import closed
from ._release import CLOSE
from ._scale import says_nothing
from ._select import any_of


def longest_step(plan, carried, attempt):
    """Return the longest step that the error allows; short steps contain little
    information about it.
    """
    h, effort = attempt.length, attempt.effort
    # single precision is sufficient for choosing a step, and much cheaper
    rough = jnp.asarray(jnp.clip(effort, 1e-12, 1e12), dtype=jnp.float32)
    rough = jnp.exp(jnp.log(rough) * jnp.float32(-1.0 / plan.tableau.order))
    factor = jnp.clip(0.9 * jnp.asarray(rough, dtype=jnp.float64), 0.2, 6.0)
    factor = jnp.where(jnp.isfinite(effort), factor, 0.1)
    # a much shorter step contains no information about the longest one
    grown = jnp.where(h < 0.5 * carried.longest, carried.longest, h * factor)
    grown = jnp.where(
        h < 0.999 * carried.longest, jnp.maximum(carried.longest, grown), grown
    )
    grown = jnp.where(any_of(carried.contact) & (effort == 0.0), carried.longest, grown)
    # an error that is only rounding contains no information about it either
    blind = says_nothing(effort, plan.tolerance)
    most = jnp.maximum(carried.longest, plan.unseen_step)
    grown = jnp.where(blind, jnp.minimum(grown, most), grown)
    failed = jnp.where(attempt.fits, carried.longest, h * factor)
    longest = jnp.where(attempt.good, grown, failed)
    return jnp.minimum(jnp.minimum(longest, plan.longest_step), plan.t1 - carried.t + h)


def next_length(functions, plan, carried, attempt, longest):
    """Return the step to the next contact or release, or the longest allowed step."""
    ahead = jnp.minimum(longest, 6.0 * carried.ramp)
    good, h = attempt.good, attempt.length
    known = (good & attempt.begins) | attempt.locates
    # the step that completes a chatter does not follow the motion: its length is unused
    whole = (h > 0) & ~carried.completing
    inverse = jnp.where(whole, 1.0, 0.0) / jnp.where(whole, h, 1.0)
    flags = closed(attempt.mode, len(carried.held), len(carried.jets))
    for k, (jet, contact) in enumerate(zip(attempt.jets, flags, strict=True)):
        parts = jet, carried.jets[k], attempt.arrived[k], inverse
        flight = functions.where(~contact, functools.partial(_flight, *parts), jnp.inf)
        ahead = jnp.minimum(ahead, flight)
        if k < len(carried.held):
            rest = functools.partial(_rest, plan, longest, *parts[1:])
            ahead = jnp.minimum(ahead, functions.where(contact & ~known, rest, jnp.inf))
    again = jnp.where(attempt.fits, jnp.minimum(attempt.shorter, h), longest)
    again = jnp.where(attempt.settling, h, again)
    again = jnp.where(attempt.finite, again, 0.25 * h)
    trial = jnp.where(good, ahead, again)
    trial = jnp.where(known, attempt.fixed, trial)
    return jnp.where(carried.completing & ~good, carried.step, trial)


def _flight(jet: Jet, left: Jet, right: Jet, inverse):
    """Return the time to the next contact, by the jet after a step and those at the
    ends of the step.
    """
    flight = time_to_contact(jet, end_curvature(left, right, inverse))
    return jnp.where(flight > 0, flight, jnp.inf)


def _rest(plan, longest, left: Jet, right: Jet, inverse):
    """Return the time to the next release, by the jets at the ends of a step."""
    held = jnp.minimum(time_to_release(left, right, inverse), plan.longest_step)
    # a multiplier that is this close to zero without a release only touches zero
    return jnp.maximum(held, CLOSE * longest)
