"""Choose the kind under which the log lists an accepted attempt."""

import jax.numpy as jnp

from ..codes import RowKind
from ._landing import Landing


def row_kind(carried, lands, begins, released, stopped):
    """Return the kind of an accepted attempt in the log: see `RowKind`."""
    kind = jnp.where(stopped, float(RowKind.STOP), float(RowKind.STEP))
    kind = jnp.where(carried.completing, float(RowKind.CONTACT), kind)
    kind = jnp.where(released, float(RowKind.RELEASE), kind)
    impact = jnp.where(begins, float(RowKind.LAST_IMPACT), float(RowKind.IMPACT))
    return jnp.where(lands, impact, kind)


def kind_of_switch(carried, landing: Landing, lands, kind):
    """Return the kind of an attempt that ends at a switching surface, else `kind`."""
    if carried.stale:
        again = (carried.stale[0] > 0) & (kind == float(RowKind.STEP))
        kind = jnp.where(again, float(RowKind.NOTHING), kind)
    crosses = lands & ~landing.strikes & ~landing.stuck
    kind = jnp.where(crosses, float(RowKind.SWITCH), kind)
    kind = jnp.where(landing.slides, float(RowKind.SLIDE), kind)
    kind = jnp.where(landing.leaves, float(RowKind.LEAVE), kind)
    return jnp.where(landing.stuck, float(RowKind.STEP), kind)


def at_section(functions, carried, landing: Landing, lands) -> tuple:
    """Return whether an attempt ends at the Poincaré section, if there is one.

    A crossing after a step of length zero is not a crossing by the flow: a jump of the
    state has crossed the section, or a contact that held the motion on it has ended.
    """
    if functions.counts is None:
        return ()
    crosses = lands & ~landing.strikes & ~landing.stuck & landing.hit[-1]
    if functions.counts:
        rises = carried.negative[-1]
        crosses = crosses & (rises if functions.counts > 0 else ~rises)
    return (crosses & (landing.t > carried.t),)
