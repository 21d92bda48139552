"""Apply the impacts on several constraints that coincide."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._functions import Functions
from ._loop_state import LoopState
from ._select import any_of, select


class Hits(NamedTuple):
    """The state after the impact on one constraint, or on several at once."""

    # whether there are several
    several: Any
    # whether the law is that of an impact on several
    joins: Any
    after: tuple
    # which constraints are hit
    hit: list


def hits_together(
    functions: Functions, carried: LoopState, hit, jets, offset, t, x, after
) -> Hits:
    """Return the impact on all constraints that are reached at the same instant.

    Their gaps cannot be distinguished from zero, and they approach. Other closed gaps
    take part, so that none of them is closed further. With friction, closed gaps take
    part in every impact, because a body may jam.

    **Arguments:** which constraint is `hit` first; the `jets` at the end of the step;
    the time of the impact after it, and as a time (s); the state before the impact; and
    the state `after` the impact on the first constraint alone.
    """
    m, several = functions.m, jnp.asarray(False)
    if not functions.joins:
        return Hits(several, several, after, hit)
    strikes = any_of(hit[:m])
    slow = functions.speed_blur(t, x, carried.mode)
    closed, all_hit = [], list(hit)
    for k, jet in enumerate(jets[:m]):
        speed = jet.velocity + offset * (jet.acceleration + offset * jet.jerk / 2)
        third = jet.acceleration / 2 + offset * jet.jerk / 6
        gap = jet.gap + offset * (jet.velocity + offset * third)
        near = jnp.abs(gap) <= 1e-14 * carried.sizes[k] + 10 * carried.blur[k]
        also = strikes & near & ~carried.contact[k] & (speed < -500 * slow[k])
        several = several | (also & ~hit[k])
        closed.append(near | carried.contact[k] | hit[k])
        all_hit[k] = hit[k] | also
    joins = several
    if functions.rubs:
        joins = strikes & any_of([closed[k] & ~hit[k] for k in range(m)])
        closed = [joins & one for one in closed]
    joint = functions.impacts_together(t, x, closed, carried.mode)
    return Hits(several, joins, select(joins, joint, after), all_hit)
