"""Begin to stick at several feet at once."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._crossing import Sides
from ._functions import Functions
from ._loop_state import LoopState
from ._select import any_of


class Together(NamedTuple):
    """The surfaces along which the motion slides from an event on."""

    slides: list
    # whether the completion of a chatter has moved the state past one of them
    passed_over: Any


def stick_together(
    functions: Functions, carried: LoopState, hit, sides: Sides, mode, t, x
) -> Together:
    """Return the surfaces along which the motion slides because it reaches several at
    once and friction holds it at all of them.

    The feet of a rigid body that lies flat come to rest at the same instant. One foot
    alone might not hold the body while the others still slip.

    **Arguments:** the state of the loop; the surface that is `hit`, after the
    constraints; the sides and the `mode` after the event; the time and the state.
    """
    none = [jnp.asarray(False) for _ in range(functions.k)]
    if not functions.rubs or len(functions.slidable) < 2:
        return Together(none, none[0] if none else jnp.asarray(False))
    trial, fresh, summed = list(sides.sliding), list(none), list(none)
    passed_over = carried.passed_over
    for k in functions.slidable:
        summed[k] = passed_over[k]
        fresh[k] = (sides.near[k] | summed[k]) & ~sides.leaves[k] & ~sides.sliding[k]
        trial[k] = trial[k] | fresh[k]
    begins = any_of(
        [hit[functions.m + k] & fresh[k] for k in functions.slidable],
    )
    number = sum(jnp.where(flag, 1.0, 0.0) for flag in trial)
    now = begins & (number > 1)

    def held():
        excess, _ = functions.hold(t, x, (*mode[: functions.m + functions.k], *trial))
        return tuple(excess)

    excess = functions.where(now, held, tuple(jnp.ones_like(t) for _ in trial))
    holds = now & ~any_of([excess[k] > 0 for k in functions.slidable])
    slides = [holds & flag for flag in fresh]
    pairs = zip(slides, summed, strict=True)
    return Together(slides, any_of([a & b for a, b in pairs]))
