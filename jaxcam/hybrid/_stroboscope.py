"""Many trajectories at once, sampled once a period."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ._advance import Plan
from ._check import check_start
from ._codes import Row
from ._functions import Functions
from ._lane import FINISHED, first_lane, RUNNING
from ._normal import gaps
from ._run import run_raw
from ._settings import Settings
from ._system import HybridSystem, with_array_parameters


# lanes of a group over lanes of a block
_GROUP = 16


class Stroboscope(eqx.Module):
    """Samples of many trajectories, as numpy arrays; NaN where a lane failed."""

    #: (lanes, turns, n) states at t0 + k period, k = 1..turns, without those skipped
    states: np.ndarray
    #: (lanes,) number of impacts and of attempted steps
    impacts: np.ndarray
    steps: np.ndarray
    #: (lanes,) 0 where the lane reached its end, else an index into `RESULTS`
    code: np.ndarray
    #: (lanes, turns) impacts in each turn, and how many of them completed a chatter
    hits: np.ndarray
    rests: np.ndarray


def stroboscope(
    system: HybridSystem,
    states,
    turns: int,
    *,
    skip: int = 0,
    t0: float = 0.0,
    where: Callable | None = None,
    values=None,
    period: float | None = None,
    settings: Settings | None = None,
    block: int = 128,
    rows: int = 96,
    max_steps: int = 1_000_000,
    workers: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Stroboscope:
    """Follow many trajectories for `turns` periods and sample each once a period.

    **Arguments:**

    - `system`: the system; `where(system)` picks one of its parameters, which takes the
      value `values[i]` in lane i (`where=lambda s: s.speed`), or a tuple of several,
      which take the row `values[i]`. Without it all lanes share the system.
    - `states`: shape `(lanes, n)`, or `(n,)` for all lanes alike.
    - `skip`: number of turns at the start that are not sampled.
    - `period`: s; the system's own forcing period by default.
    - `settings`: accuracy; the default completes chatter as soon as theory allows.
    - `block`: lanes that advance together, of which each that ends makes room for the
      next; `rows`: attempts between looks at them.
    - `max_steps`: budget of attempted steps of a lane.
    - `workers`: threads that work on blocks; results do not depend on their number.
    - `progress`: called with the fraction of lanes done.

    **Returns:** a [`jaxcam.hybrid.Stroboscope`][].

    **Raises:** `ValueError` where shapes do not fit, or there is no period.
    """
    settings = (
        Settings(tolerance=1e-9, chatter_depth=1.0) if settings is None else settings
    )
    settings.check()
    system = with_array_parameters(system)
    settings = with_array_parameters(settings)
    states = np.asarray(states, dtype=float)
    values = None if values is None else np.asarray(values, dtype=float)
    lanes = (
        states.shape[0] if states.ndim == 2 else (1 if values is None else len(values))
    )
    if states.ndim == 1:
        states = np.broadcast_to(states, (lanes, states.shape[0]))
    picked = None if where is None else where(system)
    several = (len(picked),) if isinstance(picked, tuple) else ()
    if (where is None) != (values is None) or (
        values is not None and values.shape != (lanes, *several)
    ):
        raise ValueError(
            "give where and values together, with one value for each lane: "
            f"{lanes} lanes here"
        )
    length = None if period is None else jnp.asarray(period, dtype=jnp.float64)
    if period is None and system.period is None:
        raise ValueError(
            "this system has no forcing period; pass period=... in seconds"
        )
    if turns < 1:
        raise ValueError(f"turns is {turns}; give the number of periods, 1 or more")
    if not 0 <= skip < turns:
        raise ValueError(f"skip is {skip}; it must be less than the {turns} turns")
    start = jnp.asarray(t0, dtype=jnp.float64)
    _check(*_batch(system, where, values), settings, start, length, states)

    # a group keeps its block busy until its last lanes, and bounds the memory
    width = min(block, lanes)
    shares = -(-lanes // (workers * width))
    group = width * min(_GROUP, shares)

    def work(first):
        some = slice(first, first + group)
        part = None if values is None else values[some]
        seen = _Samples(len(states[some]), turns, skip, states.shape[1])
        shape = (start, length, turns, settings, width, rows, max_steps)
        ends = _group(system, where, part, states[some], *shape, seen)
        return seen.states[:-1], *ends, *seen.counts()

    pieces = []
    with ThreadPoolExecutor(workers) as pool:
        for piece in pool.map(work, range(0, lanes, group)):
            pieces.append(piece)
            if progress is not None:
                progress(min(1.0, len(pieces) * group / lanes))
    return Stroboscope(*map(np.concatenate, zip(*pieces, strict=True)))


def _check(batched, shared, settings, t0, period, states) -> None:
    """Raise `ValueError` for lanes that cannot start; the first is checked closely."""
    first = eqx.combine(jax.tree.map(lambda leaf: leaf[0], batched), shared)
    one = jnp.asarray(states[0])
    check_start(first, settings, t0, one, t0)
    if not np.all(np.isfinite(states)):
        raise ValueError("a state is not finite; every component of each must be")

    nearest, lengths = _look(batched, shared, period, t0, jnp.asarray(states))
    if not bool(jnp.all(lengths > 0)):
        raise ValueError(
            "the period of a lane is not positive; check values and period"
        )
    low = float(jnp.min(nearest))
    if not low >= -1e-12 * (1.0 + float(np.max(np.abs(states)))):
        raise ValueError(
            f"gap is negative ({low:.1e}) at t0 in lane {int(jnp.argmin(nearest))}; "
            "start outside the constraint"
        )


@eqx.filter_jit
def _look(batched, shared, period, t0, states):
    """Smallest gap and period of each lane."""

    def one(batched, state):
        system = eqx.combine(batched, shared)
        length = system.period if period is None else period
        return jnp.min(gaps(system, t0, state)), jnp.asarray(length, dtype=jnp.float64)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)


class _Samples:
    """Samples of a group as they come, and what happened between them."""

    # rows between two looks are far fewer than this; it packs three counts in one
    _SHIFT = 20

    def __init__(self, lanes: int, turns: int, skip: int, n: int):
        self._turns, self._skip = turns, skip
        # one more than there are lanes, for slots that have none
        self.states = np.full((lanes + 1, turns - skip, n), np.nan)
        # the first is for the turns skipped
        self._hits = np.zeros((lanes + 1, turns - skip + 1), dtype=int)
        self._rests = np.zeros((lanes + 1, turns - skip + 1), dtype=int)
        # stops, impacts and completed chatters of each lane so far
        self._so_far = np.zeros((3, lanes + 1), dtype=int)
        self._weight = np.zeros(max(Row) + 1, dtype=int)
        self._weight[Row.IMPACT] = 1
        self._weight[Row.LAST_IMPACT] = 1 + (1 << self._SHIFT)
        self._weight[Row.STOP] = 1 << 2 * self._SHIFT

    @staticmethod
    def row(record):
        return [jnp.asarray(v) for v in (record.kind, *record.after)]

    def take(self, work, log) -> None:
        """Put what one stretch of the slots' log shows into its places."""
        kind = log[..., 0].astype(np.int8)
        packed = np.cumsum(self._weight[kind], axis=1)
        who, row = np.nonzero(kind == Row.STOP)
        stops, hits, rests = self._unpacked(packed[who, row])
        lane = work[who]
        place = self._so_far[0, lane] + stops - self._skip
        # rounding may set the end of the run apart from its last stop
        real = (place >= 0) & (place <= self._turns - self._skip)
        at = lane[real], place[real]
        self._hits[at] = (self._so_far[1, lane] + hits)[real]
        self._rests[at] = (self._so_far[2, lane] + rests)[real]
        real &= place > 0
        self.states[lane[real], place[real] - 1] = log[who[real], row[real], 1:]
        self._so_far[:, work] += np.stack(self._unpacked(packed[:, -1]))

    def counts(self):
        """Impacts and completed chatters in each turn; 0 where a lane failed."""
        for counts in (self._hits, self._rests):
            yield np.maximum(np.diff(counts[:-1], axis=1), 0)

    def _unpacked(self, packed):
        mask = (1 << self._SHIFT) - 1
        return (
            packed >> 2 * self._SHIFT,
            packed & mask,
            (packed >> self._SHIFT) & mask,
        )


def _group(
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
        batched, shared = _batch(system, where, part)
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
        batched, shared = _batch(system, where, part)
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


def _batch(system, where, values):
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
