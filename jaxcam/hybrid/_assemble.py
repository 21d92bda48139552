"""From the log of a run to impacts, contacts and steps."""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from ._codes import Row
from ._events import Contacts, Impacts, Steps
from ._normal import normal_velocity
from ._run import kinds, Log


class Parts(NamedTuple):
    """The padded pieces of a trajectory."""

    impacts: Impacts
    contacts: Contacts
    steps: Steps


def assemble(system, t0, state, contact, log: Log, sizes: tuple[int, int]) -> Parts:
    """Sort the rows of a log into impacts, contacts and steps of fixed lengths."""
    rows = log.kind.shape[0]
    max_impacts, max_contacts = sizes
    valid = log.kind > 0
    order = jnp.nonzero(valid, size=rows, fill_value=rows)[0]
    count = jnp.sum(valid)

    def first(start, rest, fill):
        padded = jnp.concatenate([rest, jnp.full_like(rest[:1], fill)])
        return jnp.concatenate([start[None], padded[order]])

    time = first(t0, log.t, jnp.inf)
    kept = first(contact, log.contact > 0.5, False)
    steps = Steps(time, first(state, log.after, jnp.nan), kept, count + 1)

    hits = kinds(log, Row.IMPACT, Row.LAST_IMPACT)
    number = jnp.sum(hits)
    index = jnp.nonzero(hits, size=max_impacts, fill_value=0)[0]
    real = jnp.arange(max_impacts) < number
    t_hit = jnp.where(real, log.t[index], jnp.inf)
    before = jnp.where(real[:, None], log.before[index], jnp.nan)
    after = jnp.where(real[:, None], log.after[index], jnp.nan)
    which = jnp.where(real, log.constraint[index], 0.0).astype(jnp.int32)
    impacts = Impacts(
        t_hit,
        before,
        after,
        which,
        _speeds(system, log.t[index], log.before[index], which, real),
        _speeds(system, log.t[index], log.after[index], which, real),
        number,
    )

    # a contact begins at the row after its last impact, and ends where its flag falls
    began = jnp.concatenate([kept[:1], kept[1:] & ~kept[:-1]])
    fell = jnp.concatenate([jnp.zeros_like(kept[:1]), kept[:-1] & ~kept[1:]])
    fell = fell & (jnp.arange(rows + 1) <= count)[:, None]
    reached = time[count]
    ends = jnp.where(fell, time[:, None], jnp.inf)
    ends = jax.lax.cummin(ends, axis=0, reverse=True)
    later = jnp.concatenate([time[1:], jnp.full_like(time[:1], jnp.inf)])
    starts = jnp.where(jnp.arange(rows + 1) == 0, time, later)
    width = kept.shape[1]
    flat = jnp.nonzero(began.ravel(), size=max_contacts, fill_value=0)[0]
    row, column = flat // width, flat % width
    total = jnp.sum(began & (starts[:, None] < jnp.inf))
    real = jnp.arange(max_contacts) < total
    end = ends[row, column]
    contacts = Contacts(
        jnp.where(real, starts[row], jnp.inf),
        jnp.where(real, jnp.minimum(end, reached), jnp.inf),
        real & (end < jnp.inf),
        jnp.where(real, column, 0).astype(jnp.int32),
        total,
    )
    return Parts(impacts, contacts, steps)


def _speeds(system, times, states, which, real):
    speeds = jax.vmap(lambda t, x: normal_velocity(system, t, x))(times, states)
    picked = jnp.take_along_axis(speeds, which[:, None], axis=1)[:, 0]
    return jnp.where(real, picked, jnp.nan)
