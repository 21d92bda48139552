"""Check that a state in contact lies on the surfaces of its constraints."""

import jax.numpy as jnp

from ._functions import Functions
from ._landing import Landing
from ._loop_state import LoopState
from ._select import any_of
from ._step import Step


def settles(
    functions: Functions, carried: LoopState, made: Step, landing: Landing, settled
):
    """Return whether moving the state onto the surface once more hardly changes it."""
    pairs = zip(settled, made.scale, strict=True)
    allowed = [1e-7 * (jnp.abs(a) + w) for a, w in pairs]
    if functions.m > 1:
        # a component that has never moved, such as the angle of a body that lands flat,
        # has no scale, so the rounding of the gaps is allowed as well
        for k, blur in enumerate(carried.blur[: functions.m]):
            ways = zip(made.frame.lift[k], made.frame.push[k], strict=True)
            moves = [jnp.abs(a) + jnp.abs(b) / carried.longest for a, b in ways]
            allowed = [f + blur * m for f, m in zip(allowed, moves, strict=True)]
    near = [
        jnp.abs(a - b) <= most
        for a, b, most in zip(settled, landing.x, allowed, strict=True)
    ]
    return ~any_of([~n for n in near])
