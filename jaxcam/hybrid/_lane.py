"""What one trajectory carries from one iteration of the loop to the next."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from ._functions import Functions
from ._gap_polynomial import Jet
from ._select import largest


RUNNING, FINISHED, STEP_FAILED, NOT_FINITE = 0.0, 1.0, 2.0, 3.0


class Lane(NamedTuple):
    """All scalars, so that a batch of lanes is a set of plain vectors."""

    t: Any
    x: tuple
    contact: tuple
    jets: tuple
    # the next step to try, and the longest one that the error allows
    step: Any
    longest: Any
    # the end of this step is an accumulation of impacts, not a choice
    completing: Any
    stops: Any
    # fastest rebound since the last release; largest gap of each constraint
    fastest: Any
    scale: tuple
    # how fast each gap changes by time alone: what the rounding of a late time does
    drift: tuple
    failures: Any
    status: Any
    steps: Any
    impacts: Any
    # impacts after which the rest of a chatter was summed
    chatters: Any


def first_lane(functions: Functions, t0, x, t1) -> Lane:
    """The lane at its start: in contact where gap and velocity are zero and a < 0."""
    free = tuple(jnp.asarray(False) for _ in range(functions.m))
    jets = functions.jets(t0, x, free)
    lifts = functions.lift(t0, x)
    size = largest([jnp.abs(e) for e in x])
    tiny = 1e-12 * (1.0 + size)
    contact, settled = [], []
    for jet, lift in zip(jets, lifts, strict=True):
        gap, velocity = jet.gap, jet.velocity
        near = jnp.abs(gap) <= tiny
        # a hop so low that rounding hides it is none
        hop = 1e-12 * size * jnp.abs(jet.acceleration)
        low = (velocity > 0) & (jet.acceleration < 0) & (velocity * velocity <= hop)
        touching = near & ((jnp.abs(velocity) <= tiny) | low)
        contact.append(touching & (jet.acceleration < 0))
        # off the surface a start is taken as it is; on it, rounding is removed
        behind = near & (gap < 0)
        shift = jax.lax.stop_gradient(jnp.where(behind, gap, 0.0))
        x = tuple(a - shift * b for a, b in zip(x, lift, strict=True))
        settled.append(
            Jet(
                jnp.where(touching | behind, 0.0, gap),
                jnp.where(touching, 0.0, jet.velocity),
                jet.acceleration,
                jet.jerk,
            )
        )
    whole = t1 - t0
    one = jnp.ones_like(t0)
    return Lane(
        t=t0,
        x=x,
        contact=tuple(contact),
        jets=tuple(settled),
        step=whole / 64,
        longest=whole / 64,
        completing=jnp.asarray(False),
        stops=0.0 * one,
        fastest=0.0 * one,
        scale=tuple(jnp.abs(j.gap) for j in settled),
        drift=tuple(map(jax.lax.stop_gradient, functions.drift(t0, x))),
        failures=0.0 * one,
        status=RUNNING * one,
        steps=0.0 * one,
        impacts=0.0 * one,
        chatters=0.0 * one,
    )
