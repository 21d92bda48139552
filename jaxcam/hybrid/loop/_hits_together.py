"""Apply impacts on several constraints at the same instant."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._functions import Functions
from ._loop_state import LoopState
from ._select import any_of


class Hits(NamedTuple):
    """The state after the impact on one constraint, or on several at once."""

    # whether several constraints are hit at the same instant
    several: Any
    # whether the impact law for several constraints applies
    joins: Any
    after: tuple
    # which constraints are hit
    hit: list


def hits_together(
    functions: Functions, carried: LoopState, hit, jets, offset, t, x, after
) -> Hits:
    """Return the impact on all constraints that are reached at the same instant.

    These are the constraints whose gaps are closing and cannot be distinguished from
    zero. Other closed gaps take part in such an impact, so that none of them closes
    further. With friction, closed gaps take part in every impact, because a body may
    jam.

    **Arguments:** which constraint is `hit` first; the `jets` at the end of the step;
    the time from there to the impact (`offset`), and the time `t` of the impact (s);
    the state `x` before it; and the state `after` the impact on the first constraint
    alone.
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
    after = functions.where(
        joins,
        lambda: functions.impacts_together(t, x, closed, carried.mode),
        tuple(after),
    )
    return Hits(several, joins, after, all_hit)
