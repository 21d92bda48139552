"""Lyapunov exponents of a motion with impacts.

The event loop runs without derivatives; those of its steps are taken from its log
afterwards, all at once, and multiplied in order.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem, Settings
from jaxcam.hybrid._advance import Plan
from jaxcam.hybrid._codes import Row
from jaxcam.hybrid._functions import Functions
from jaxcam.hybrid._lane import first_lane, RUNNING
from jaxcam.hybrid._run import run_raw
from jaxcam.hybrid._system import with_array_parameters

from ._event_law import completed_law
from ._step_matrix import LogRow, Point, step_matrix


class LyapunovSpectrum(eqx.Module):
    """Lyapunov exponents (1/s), one set for each lane where there are several."""

    #: (n,) or (lanes, n), the largest first
    exponents: Float[Array, "*lanes n"]
    #: standard error of each, from the scatter of blocks of consecutive turns
    stderr: Float[Array, "*lanes n"]
    #: impacts per second
    impact_rate: Float[Array, "*lanes"]
    #: (turns, n) finite-time exponents, each over one turn
    local: Float[Array, "*lanes turns n"]
    #: (n,) state at the end, to go on from
    state: Float[Array, "*lanes n"]
    #: s, length of a turn
    turn: Float[Array, "*lanes"]
    #: 0 where every turn was finished, else an index into `RESULTS`; the exponents are
    #: NaN there
    code: Array

    @property
    def running(self) -> Float[Array, "*lanes turns n"]:
        """The exponents over the first 1, 2, ... turns, to see them settle."""
        number = self.local.shape[-2]
        count = jnp.arange(1.0, number + 1)[:, None]
        return jnp.cumsum(self.local, axis=-2) / jnp.broadcast_to(
            count, self.local.shape
        )


def lyapunov_spectrum(
    system: HybridSystem,
    state,
    turns: int = 500,
    *,
    t0: float = 0.0,
    transient: int = 100,
    turn: float | None = None,
    where: Callable | None = None,
    values=None,
    settings: Settings | None = None,
    blocks: int = 16,
    max_steps: int = 10_000_000,
) -> LyapunovSpectrum:
    """All Lyapunov exponents, impacts included, by repeated orthogonalisation.

    The steps of a run are differentiated one by one, saltation matrices are put in at
    its events, and the product is applied to a frame that is made orthonormal again and
    again (Benettin et al., Meccanica 15, 1980; for impacts Mueller, Chaos, Solitons and
    Fractals 5, 1995).

    **Arguments:**

    - `state`: shape `(n,)`, or `(lanes, n)` for many motions at once.
    - `turns`: how many are averaged, after `transient` others.
    - `t0`: s.
    - `turn`: s, length of a turn; the forcing's period without.
    - `where`, `values`: `where(system)` picks one parameter, which takes `values[i]` in
        lane i.
    - `settings`: accuracy; a tolerance of 1e-12 by default.
    - `blocks`: number of blocks for the standard error.
    - `max_steps`: budget of attempted steps of a lane.

    **Returns:** a [`variational.LyapunovSpectrum`][]. An exponent is minus infinity
    where the motion sticks, because contact forgets what came before.

    **Raises:** `ValueError` where shapes do not fit, or there is no period.
    """
    settings = Settings(tolerance=1e-12) if settings is None else settings
    settings.check()
    if turn is None and system.period is None:
        raise ValueError("this system has no forcing period; pass turn=... in seconds")
    if not 2 <= blocks <= turns:
        raise ValueError(
            f"{turns} turns cannot be split into {blocks} blocks; give at least two "
            "blocks, and as many turns"
        )
    if (where is None) != (values is None):
        raise ValueError("give where and values together, one value for each lane")
    system = with_array_parameters(system)
    settings = with_array_parameters(settings)
    state = jnp.asarray(state, dtype=jnp.float64)
    single = state.ndim == 1 and values is None
    batched, shared, states = _lanes(system, state, where, values)
    length = None if turn is None else jnp.asarray(float(turn))
    begin = jnp.asarray(float(t0))
    end = jnp.asarray(float(transient + turns))

    def some(batched, states):
        carry = _first(batched, shared, length, states, begin, end, settings)
        seen = _Seen(states.shape[0], transient + turns + 1, states.shape[1])
        used = 0
        while used < max_steps and np.any(np.asarray(carry.lane.status) == RUNNING):
            carry, rows = _some(batched, shared, length, begin, end, settings, carry)
            seen.take(*map(np.asarray, rows))
            used += _ROWS
        return _summary(seen, carry, _turn(batched, shared, length), transient, blocks)

    made = _in_turn(some, batched, states)
    return jax.tree.map(lambda leaf: leaf[0], made) if single else made


def _in_turn(some: Callable, batched, states):
    """`some(batched, states)` for a block of lanes after the other, put together.

    Blocks are alike, so that one program serves all; the last lane fills them up.
    """
    lanes = states.shape[0]
    count = -(-lanes // _BLOCK)
    if count == 1:
        return some(batched, states)
    size = -(-lanes // count)
    order = np.minimum(np.arange(count * size), lanes - 1).reshape(count, size)
    parts = [
        some(jax.tree.map(lambda leaf, k=k: leaf[k], batched), states[k]) for k in order
    ]
    # the length of a turn is one for all where nothing else differs
    alike = parts[0].turn.shape[0] == 1
    whole = jax.tree.map(lambda *leaves: jnp.concatenate(leaves)[:lanes], *parts)
    return eqx.tree_at(lambda m: m.turn, whole, parts[0].turn) if alike else whole


class _Carry(NamedTuple):
    """What a lane takes from one chunk of rows to the next."""

    lane: Any
    point: Point
    frame: Float[Array, "n n"]
    logs: Float[Array, " n"]


class _Seen:
    """Sums of the logarithms and numbers of impacts at the end of each turn."""

    def __init__(self, lanes: int, stops: int, n: int):
        self.logs = np.full((lanes, stops, n), np.nan)
        self.hits = np.full((lanes, stops), np.nan)
        self.states = np.full((lanes, n), np.nan)
        self.logs[:, 0], self.hits[:, 0] = 0.0, 0.0
        self._filled = np.ones(lanes, dtype=int)
        self._hits = np.zeros(lanes)

    def take(self, kind, logs, after) -> None:
        hit = (kind == Row.IMPACT) | (kind == Row.LAST_IMPACT)
        hits = self._hits[:, None] + np.cumsum(hit, axis=1)
        stop = kind == Row.STOP
        rank = self._filled[:, None] + np.cumsum(stop, axis=1) - 1
        who, row = np.nonzero(stop)
        # rounding may set the end of the run apart from its last stop
        real = rank[who, row] < self.logs.shape[1]
        who, row = who[real], row[real]
        self.logs[who, rank[who, row]] = logs[who, row]
        self.hits[who, rank[who, row]] = hits[who, row]
        self.states[who] = after[who, row]
        self._filled += stop.sum(axis=1)
        self._hits = hits[:, -1]


def _summary(seen: _Seen, carry: _Carry, length, transient, blocks):
    length = np.asarray(length)
    with np.errstate(invalid="ignore"):
        # the difference of two infinities: it stuck before, and this turn as well
        local = np.diff(seen.logs[:, transient:], axis=1) / length[:, None, None]
    stuck = np.isneginf(seen.logs[:, transient + 1 :])
    local = np.where(stuck & np.isnan(local), -np.inf, local)
    lanes, turns, n = local.shape
    size = turns // blocks
    means = local[:, : size * blocks].reshape(lanes, blocks, size, n).mean(axis=2)
    with np.errstate(invalid="ignore"):
        error = means.std(axis=1, ddof=1) / np.sqrt(blocks)
    error = np.where(np.isneginf(local).any(axis=1), 0.0, error)
    impacts = seen.hits[:, -1] - seen.hits[:, transient]
    status = np.asarray(carry.lane.status).astype(int)
    return LyapunovSpectrum(
        exponents=jnp.asarray(local.mean(axis=1)),
        stderr=jnp.asarray(error),
        impact_rate=jnp.asarray(impacts / (turns * length)),
        local=jnp.asarray(local),
        state=jnp.asarray(seen.states),
        turn=jnp.asarray(length),
        code=jnp.asarray(np.array([1, 0, 2, 3])[status]),
    )


def _lanes(system, state, where, values):
    """The system split in what differs between lanes and what they share."""
    if where is None:
        return None, system, jnp.atleast_2d(state)
    values = jnp.asarray(values, dtype=jnp.float64)
    if values.ndim != 1:
        raise ValueError(f"values has shape {values.shape}; pass one for each lane")
    if state.ndim == 1:
        state = jnp.broadcast_to(state, (values.shape[0], state.shape[0]))
    if state.shape[0] != values.shape[0]:
        raise ValueError(
            f"{state.shape[0]} states and {values.shape[0]} values; give one of each "
            "for every lane"
        )
    picked = eqx.tree_at(where, jax.tree.map(lambda _: False, system), True)
    batched, shared = eqx.partition(eqx.tree_at(where, system, values), picked)
    return batched, shared, state


# rows of the log between two looks from Python
_ROWS = 256
# lanes in one program: their logs stay in the cache, and they wait less for each other
_BLOCK = 128
# the widest vectors that the machine has; XLA is shy of them by default
_WIDE: dict[str, Any] = {"compiler_options": {"xla_cpu_prefer_vector_width": 512}}


def _plan(system, length, t0, turns, settings) -> Plan:
    length = system.period if length is None else length
    end = t0 + turns * length
    # shorter in contact, where the tangent is carried along
    plan = Plan.of(system, settings, t0, end, period=length, stop_period=length)
    return plan._replace(longest_step=length / 8)


@eqx.filter_jit
def _turn(batched, shared, length):
    """Length of a turn in each lane, shape `(lanes,)`, or `(1,)` for all alike."""

    def one(batched):
        system = eqx.combine(batched, shared)
        return system.period * 1.0 if length is None else length

    if batched is None:
        return one(None)[None]
    return eqx.filter_vmap(one, in_axes=eqx.if_array(0))(batched)


@eqx.filter_jit
def _first(batched, shared, length, states, t0, turns, settings):
    def one(batched, state):
        system = eqx.combine(batched, shared).prepared()
        x = tuple(state[i] for i in range(state.shape[0]))
        plan = _plan(system, length, t0, turns, settings)
        lane = first_lane(Functions(system, len(x)), t0, x, plan.t1)
        lane = jax.tree.map(jnp.asarray, lane)
        point = Point(lane.t, lane.x, lane.contact)
        n = len(x)
        return _Carry(lane, point, jnp.eye(n), jnp.zeros(n))

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)


def _row(record, _):
    head = [record.kind, record.constraint, record.t]
    flags = [jnp.asarray(c, dtype=jnp.float64) for c in record.contact]
    return [jnp.asarray(v) for v in (*head, *record.before, *record.after, *flags)]


@eqx.filter_jit(**_WIDE)
def _some(batched, shared, length, t0, turns, settings, carry: _Carry):
    def one(batched, carry):
        system = eqx.combine(batched, shared).prepared()
        n = len(carry.lane.x)
        functions = Functions(system, n)
        plan = _plan(system, length, t0, turns, settings)
        lane, log = run_raw(functions, plan, carry.lane, _ROWS, _row)
        kind, side, t = log[:, 0], log[:, 1].astype(jnp.int32), log[:, 2]
        before, after = log[:, 3 : 3 + n], log[:, 3 + n : 3 + 2 * n]
        contact = log[:, 3 + 2 * n :] > 0.5
        taken = kind != float(Row.NOTHING)
        started = after
        if not functions.planar:
            # what follows a chatter starts without normal velocity
            rest = jax.vmap(lambda s, y, k: completed_law(system, k)(s, y))
            at_rest = (kind == float(Row.LAST_IMPACT))[:, None]
            started = jnp.where(at_rest, rest(t, before, side), after)

        def first_and(old, new):
            return jnp.concatenate([jnp.asarray(old)[None], new])

        # the latest row that was taken, counted from the one before the first
        latest = jax.lax.cummax(jnp.where(taken, jnp.arange(1, kind.shape[0] + 1), 0))
        previous = jnp.concatenate([jnp.zeros_like(latest[:1]), latest[:-1]])
        times = first_and(carry.point.t, t)
        states = first_and(jnp.stack(carry.point.x), started)
        flags = first_and(jnp.stack(carry.point.contact), contact)

        def point_at(k):
            return Point(times[k], tuple(states[k].T), tuple(flags[k].T))

        rows = LogRow(kind, side, t, tuple(before.T), tuple(after.T), tuple(contact.T))
        matrices = jax.vmap(
            lambda p, r: step_matrix(system, functions, plan.tableau, p, r)
        )(point_at(previous), rows)

        def extend(carry, matrix):
            frame, logs = carry
            frame, growth = orthonormal(_times(matrix, frame))
            logs = logs + jnp.log(growth)
            return (frame, logs), logs

        (frame, logs), sums = jax.lax.scan(extend, (carry.frame, carry.logs), matrices)
        at = point_at(latest[-1])
        return _Carry(lane, at, frame, logs), (kind, sums, after)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, carry)


def _times(a, b):
    """A matrix product that stays elementwise in a batch."""
    return jnp.sum(a[:, :, None] * b[None, :, :], axis=1)


def orthonormal(matrix: Float[Array, "n n"]):
    """Orthonormal columns that span the same, and the lengths they had (Gram-Schmidt).

    A column of zeros stays one.
    """
    columns, lengths = [], []
    for k in range(matrix.shape[0]):
        column = matrix[:, k]
        # twice is enough
        for _ in range(2):
            for earlier in columns:
                column = column - jnp.sum(earlier * column) * earlier
        length = jnp.sqrt(jnp.sum(column * column))
        columns.append(column / jnp.where(length > 0, length, 1.0))
        lengths.append(length)
    return jnp.stack(columns, axis=1), jnp.stack(lengths)
