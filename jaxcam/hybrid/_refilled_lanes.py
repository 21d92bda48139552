"""A group of lanes in fewer slots: one that ends makes room for the next."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._advance import Plan
from ._functions import Functions
from ._lane import FINISHED, first_lane, RUNNING
from ._run import run_raw


def run_refilled(
    system,
    where,
    values,
    states,
    t0,
    period,
    turns,
    settings,
    width,
    rows,
    max_steps,
    seen,
):
    """Run some lanes, `width` at a time; a lane that ends makes room for the next.

    Lanes do not know of each other, so their order and company change no result.
    `seen` takes the log, one `seen.row` an attempt, as it comes.
    """
    lanes = len(states)
    ends = np.zeros((lanes + 1, 3), dtype=int)
    end = jnp.asarray(float(turns))
    started = _start(system, where, values, states, t0, period, end, settings, width)
    values = None if values is None else np.concatenate([values, values[-1:]])
    work, used = np.minimum(np.arange(width), lanes), np.zeros(width)
    lane = jax.tree.map(lambda leaf: leaf[work], started)
    running, waiting = work < lanes, min(width, lanes)
    lane = lane._replace(status=np.where(running, lane.status, FINISHED))
    while np.any(running):
        part = None if values is None else values[work]
        batched, shared = split_lanes(system, where, part)
        shape = (period, t0, end, settings, lane, rows, seen.row)
        lane, log = _some(batched, shared, *shape)
        seen.take(work, np.asarray(log))
        used += rows
        status = np.array(lane.status)
        over = running & ((status != RUNNING) | (used >= max_steps))
        if not np.any(over):
            continue
        counts = status, np.asarray(lane.impacts), np.asarray(lane.steps)
        ends[work[over]] = np.stack(counts, axis=1)[over]
        # who has used up the budget stays where it is
        status[over], running[over] = FINISHED, False
        slots = np.flatnonzero(over)[: lanes - waiting]
        fresh = np.arange(waiting, waiting + len(slots))
        work[slots], used[slots], running[slots] = fresh, 0, True
        waiting += len(slots)
        lane = _exchanged(lane._replace(status=status), started, slots, fresh)
    codes = np.array([1, 0, 2, 3])[ends[:lanes, 0]]
    return ends[:lanes, 1], ends[:lanes, 2], codes


def _start(system, where, values, states, t0, period, end, settings, width):
    """All lanes as they start, as numpy arrays; computed `width` at a time.

    There is one more than there are states, to fill slots with.
    """
    pieces = []
    for first in range(0, len(states) + 1, width):
        # filled up, so that one compiled program serves all
        some = np.minimum(np.arange(first, first + width), len(states) - 1)
        part = None if values is None else values[some]
        batched, shared = split_lanes(system, where, part)
        start = jnp.asarray(states[some])
        lane = _first(batched, shared, period, start, t0, end, settings)
        pieces.append(jax.tree.map(np.asarray, lane))
    return jax.tree.map(lambda *parts: np.concatenate(parts), *pieces)


def _exchanged(lane, started, slots, which):
    def put(now, fresh):
        now = np.array(now)
        now[slots] = fresh[which]
        return now

    return jax.tree.map(put, lane, started)


def split_lanes(system, where, values):
    """The system as a batched and a shared part for `filter_vmap`."""
    if where is None:
        return None, system
    nothing = jax.tree.map(lambda _: False, system)
    picked = eqx.tree_at(where, nothing, replace_fn=lambda _: True)
    values = jnp.asarray(values)
    several = isinstance(where(system), tuple)
    full = eqx.tree_at(where, system, tuple(values.T) if several else values)
    return eqx.partition(full, picked)


def _plan(system, period, t0, turns, settings):
    period = system.period if period is None else period
    end = t0 + turns * period
    return Plan.of(system, settings, t0, end, period=period, stop_period=period)


@eqx.filter_jit
def _first(batched, shared, period, states, t0, turns, settings):
    t0 = jnp.asarray(t0, dtype=jnp.float64)

    def one(batched, state):
        system = eqx.combine(batched, shared).prepared()
        plan = _plan(system, period, t0, turns, settings)
        x = tuple(state[i] for i in range(state.shape[0]))
        return first_lane(Functions(system, len(x)), t0, x, plan.t1)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)


# the widest vectors that the machine has; XLA is shy of them by default
_WIDE: dict[str, Any] = {"compiler_options": {"xla_cpu_prefer_vector_width": 512}}


@eqx.filter_jit(**_WIDE)
def _some(batched, shared, period, t0, turns, settings, lane, rows, row):
    t0 = jnp.asarray(t0, dtype=jnp.float64)

    def one(batched, lane):
        system = eqx.combine(batched, shared).prepared()
        plan = _plan(system, period, t0, turns, settings)
        functions = Functions(system, len(lane.x))
        return run_raw(functions, plan, lane, rows, row, batch=True)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, lane)
