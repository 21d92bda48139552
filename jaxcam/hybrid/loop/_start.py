"""Reject invalid starts, traced or not."""

import jax.numpy as jnp

from ..codes import BACKWARD, BEHIND, NOT_FINITE, RUNNING
from ..surface import gaps, least_gaps
from ._select import any_of


def starts_behind(system, t, state):
    """Return whether a state is behind a constraint, and the gaps, shape `(m,)`."""
    return jnp.any(least_gaps(system, t, state) < 0), gaps(system, t, state)


def first_status(t0, x, t1, gaps, rooms):
    """Return the status of a run at its start: `RUNNING`, or the reason for an error.

    **Arguments:** times (s), the state, all gaps and their resolution (`start_room`) as
    tuples of scalars.
    """
    behind = any_of([gap + room < 0 for gap, room in zip(gaps, rooms, strict=True)])
    finite = jnp.isfinite(sum(x) + sum(gaps) + t0 + t1)
    status = jnp.where(behind, BEHIND, RUNNING)
    status = jnp.where(finite, status, NOT_FINITE)
    return jnp.where(t1 < t0, BACKWARD, status)
