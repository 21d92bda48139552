"""Run batches of motions of a hybrid system, check their initial states, and compute
default ones.
"""

import sys
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ...hybrid import HybridSystem, Settings
from ...hybrid.batch import (
    Chunking,
    Horizon,
    Lanes,
    run_refilled,
    split_lanes,
    Table,
)
from ...hybrid.checks import check_system
from ...hybrid.loop import starts_behind
from ...hybrid.programs import program
from ...hybrid.sizes import component_sizes
from ...hybrid.surface import contact_state, gaps, least_gaps
from ...parameters import as_arrays
from ._samples import BEHIND


_WIDTHS = ((32, 16), (512, 48), (sys.maxsize, 1 << 16))
"""Pairs of a total number of motions, and the number of motions that advance together
up to this total.
"""


class Rows(NamedTuple):
    """The rows that a section stores from the log of each motion; see `Table`."""

    row: Callable
    places: int
    columns: int
    settings: Settings


def chunk_rows(width: int) -> int:
    """Return the number of attempted steps between two checks for finished motions.

    Frequent checks take time; rare ones leave finished motions in the batch.
    """
    # in a small batch, checks take a larger share of the time
    return 1024 if width < 16 else 64


def smallest_gaps(
    system: HybridSystem, t0, states, where=None, values=None, room: float = 0.0
):
    """Return the smallest gap of each state at `t0`, shape `(motions,)`; infinite for a
    system without constraints.

    Each gap is increased by `room` times its resolution.
    """
    batched, shared = split_lanes(as_arrays(system), where, values)
    parts = jnp.asarray(t0, float), _rows(states), jnp.asarray(room, float)
    return np.asarray(_gaps(batched, shared, *parts))


def admissible(system: HybridSystem, t0, states, where=None, values=None):
    """Return whether each state is finite and penetrates no constraint at `t0`."""
    states = np.asarray(states, dtype=float)
    finite = np.all(np.isfinite(states), axis=1)
    batched, shared = split_lanes(as_arrays(system), where, values)
    rows = _rows(np.where(finite[:, None], states, 0.0))
    behind, found = _behind(batched, shared, jnp.asarray(t0, float), rows)
    return finite & np.all(np.isfinite(found), axis=1) & ~np.asarray(behind)


def lifted(system: HybridSystem, t0, states, where=None, values=None) -> np.ndarray:
    """Move states that penetrate a constraint at `t0` onto it; others are unchanged."""
    states = np.asarray(states, dtype=float)
    if np.all(smallest_gaps(system, t0, states, where, values) >= 0):
        return states
    batched, shared = split_lanes(as_arrays(system), where, values)
    return np.asarray(_lifted(batched, shared, jnp.asarray(t0, float), _rows(states)))


def state_in_contact(system: HybridSystem, t0, where=None, values=None) -> np.ndarray:
    """Return the state in contact at `t0` with zero velocity relative to the
    constraint.

    Raises:
        ValueError: A state does not have two components, or there are several
            constraints.
    """
    names = system.state_names
    gap = jax.eval_shape(system.gap, jnp.asarray(t0, float), jnp.zeros(2))
    if (names and len(names) != 2) or gap.size != 1:
        raise ValueError(
            "the default start, in sustained contact, exists for two states and one "
            "constraint; pass the states to start from"
        )
    batched, shared = split_lanes(as_arrays(system), where, values)
    t0 = jnp.asarray(t0, float)
    if batched is None:
        return np.asarray(_contact_states(None, shared, t0))[None]
    return np.asarray(_contact_states(batched, shared, t0))


def turn_lengths(system: HybridSystem, period, where=None, values=None) -> np.ndarray:
    """Return the length of a period (s) of each motion, shape `(motions,)`, or `(1,)`
    if equal.

    Raises:
        ValueError: The system has no period and none is given.
    """
    length = system.period if period is None else period
    if length is None:
        raise ValueError(
            "this system has no forcing period; pass period=... in seconds"
        )
    if period is not None or where is None:
        return np.array([float(length)])
    return np.asarray(_periods(*split_lanes(as_arrays(system), where, values)))


def lane_sizes(system: HybridSystem, times, states, turns, where=None, values=None):
    """Return the scale of each component of each motion, shape `(motions, n)`."""
    batched, shared = split_lanes(as_arrays(system), where, values)
    times, turns = (
        jnp.broadcast_to(jnp.asarray(x, float), (len(states),)) for x in (times, turns)
    )
    return np.asarray(_sizes(batched, shared, times, _rows(states), turns))


def run_lanes(run, system, t0, states, where, values, lanes: int, tails):
    """Run the motions that can start, in batches of a few different widths.

    Args:
        run: `run(states, values, width)` returns arrays with one row for each
            motion, the last of them the code.
        lanes: Maximum number of motions that advance together.
        tails: Shape of one row of each array.

    Returns:
        The same arrays for all motions; rows of motions that failed, or whose initial
            state is inadmissible, are NaN or zero, with the code `BEHIND` or the
            reason.
    """
    states = np.asarray(states, dtype=float)
    values = None if values is None else np.asarray(values, dtype=float)
    ready = admissible(system, t0, states, where, values)
    count = len(states)
    # few widths, because each needs a separate program; several motions per position,
    # so that few positions are idle at the end
    width = 1 if count == 1 else next(w for most, w in _WIDTHS if count <= most)
    width = min(lanes, width)
    code = np.full(count, BEHIND)
    if not np.any(ready):
        return (*(np.full((count, *tail), np.nan) for tail in tails), code)
    # motions that cannot start, and unused positions, repeat a motion that can start
    one = int(np.argmax(ready))
    index = np.full(max(count, width), one)
    index[:count] = np.where(ready, np.arange(count), one)
    some = None if values is None else values[index]
    *parts, ends = (part[:count] for part in run(states[index], some, width))
    code = np.where(ready, ends, code)
    made = []
    for part in parts:
        part = np.array(part)
        part[code != 0] = np.nan if part.dtype.kind == "f" else 0
        made.append(part)
    return (*made, code)


def run_tables(section, rows: "Rows", states, turns, where, values, watched=None):
    """Run the motions of a section that can start, and store rows of their logs.

    Args:
        section: The section, with `system`, `t0`, `period`, `lanes` and `max_steps`.
        rows: The rows to store, and the settings.
        watched: The system to run, and its `where`; by default those of the section.

    Returns:
        The table, `(motions, places, columns)`; impacts and codes of the motions.
    """
    rows.settings.check()
    # this raises an error if there is no period
    section.turn(where, values)
    _check_first(section, rows.settings, states, where, values)
    system, chosen = (section.system, where) if watched is None else watched
    system, settings = as_arrays(system), as_arrays(rows.settings)
    period = section.period
    period = None if period is None else jnp.asarray(period, jnp.float64)
    when = Horizon(jnp.asarray(section.t0, dtype=jnp.float64), period, turns)

    def run(states, values, width):
        table = Table(rows.row, len(states), rows.places, rows.columns)
        chunking = Chunking(width, chunk_rows(width), section.max_steps)
        lanes = Lanes(system, chosen, values, states)
        impacts, _, code = run_refilled(lanes, when, settings, chunking, table)
        return table.numbers, impacts, code

    parts = section.system, section.t0, states, where, values, section.lanes
    tails = (rows.places, rows.columns), ()
    numbers, impacts, code = run_lanes(run, *parts, tails)
    return numbers, np.nan_to_num(impacts).astype(int), code


def _check_first(section, settings, states, where, values) -> None:
    """Raise `ValueError` if the system of the first motion with a finite state is
    invalid.
    """
    finite = np.flatnonzero(np.isfinite(states).all(axis=1))
    if not len(finite):
        return
    lane = int(finite[0])
    batched, shared = split_lanes(as_arrays(section.system), where, values)
    first = eqx.combine(jax.tree.map(lambda leaf: leaf[lane], batched), shared)
    start = jnp.asarray(section.t0, dtype=jnp.float64), jnp.asarray(states[lane])
    check_system(first, *start, as_arrays(settings))


def _rows(states):
    return jnp.asarray(np.asarray(states, dtype=float))


@program
def _gaps(batched, shared, t0, states, room):
    def one(batched, state):
        found = least_gaps(eqx.combine(batched, shared), t0, state, room)
        return jnp.min(found, initial=jnp.inf)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)


@program
def _sizes(batched, shared, times, states, turns):
    def one(batched, t, state, turn):
        return component_sizes(eqx.combine(batched, shared), t, state, turn)

    axes = (eqx.if_array(0), 0, 0, 0)
    return eqx.filter_vmap(one, in_axes=axes)(batched, times, states, turns)


@program
def _behind(batched, shared, t0, states):
    def one(batched, state):
        return starts_behind(eqx.combine(batched, shared), t0, state)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)


@program
def _lifted(batched, shared, t0, states):
    def one(batched, state):
        system = eqx.combine(batched, shared)

        def worst(x):
            return jnp.min(gaps(system, t0, x))

        # Newton steps along the gradient of the gap, which is nearly linear so close by
        for _ in range(6):
            gap, slope = jax.value_and_grad(worst)(state)
            state = state + jnp.maximum(-gap, 0.0) * slope / jnp.sum(slope * slope)
        return state

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)


@program
def _contact_states(batched, shared, t0):
    def one(batched):
        system = eqx.combine(batched, shared)
        return contact_state(system, t0[None], jnp.zeros(2))[0]

    if batched is None:
        return one(None)
    return eqx.filter_vmap(one, in_axes=eqx.if_array(0))(batched)


@program
def _periods(batched, shared):
    def one(batched):
        return eqx.combine(batched, shared).period * 1.0

    return eqx.filter_vmap(one, in_axes=eqx.if_array(0))(batched)
