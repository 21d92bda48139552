"""Whether the rest of a chatter may follow an impact in no time, and where it ends."""

from typing import Any, NamedTuple

import jax.numpy as jnp

from ._chatter import completion_time
from ._select import pick, select


class Rest(NamedTuple):
    """The rest of a chatter, as if it began with this impact."""

    possible: Any
    duration: Any
    state: tuple
    acceleration: Any
    rate: Any


def rest_of_chatter(
    functions, plan, lane, t, before, after, v_before, rebound, jets, flown, stop
) -> Rest:
    """The completion of the sequence after this impact, and whether it may be used.

    **Arguments:** time (s) and states `before` and `after` the impact; the normal
    velocities `v_before` and `rebound`; the `jets` of all gaps after it; the verdict
    `flown`, which names the constraint; and where the run has to `stop` (s). Scalars
    and tuples of them.
    """
    dampings, restitutions, states = functions.chatter(t, before, after)
    damping = pick(dampings, flown.constraint)
    r0 = pick(restitutions, flown.constraint)
    state = states[0]
    for k in range(1, functions.m):
        state = select(flown.constraint == k, states[k], state)
    a = pick([j.acceleration for j in jets], flown.constraint)
    j = pick([j.jerk for j in jets], flown.constraint)
    small = rebound * jnp.abs(j) <= plan.smallness * (1 - r0) * a * a
    possible = (a < 0) & small & (r0 < 1)
    # quantities of the state without normal velocity
    a = jnp.where(possible, a - damping * rebound, -1.0)
    rate = j - damping * a
    r0 = jnp.where(possible, r0, 0.0)
    incoming = jnp.where(v_before < 0, -v_before, 1.0)
    inverse = 1 / incoming
    softening = (rebound * inverse - r0) * inverse
    duration = completion_time(rebound, a, rate, damping, r0, softening)
    at_end = a + rate * duration
    soon = (t + duration <= stop) | (duration <= 1e-13 * jnp.abs(t))
    return Rest(possible & (a < 0) & (at_end < 0) & soon, duration, state, a, rate)
