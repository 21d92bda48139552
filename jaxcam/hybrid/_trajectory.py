"""What a simulation returns: impacts, contacts, and the state at any time."""

from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ._check import is_traced
from ._codes import RESULTS, Row
from ._functions import Functions
from ._normal import field_in_force, gaps, normal_velocity
from ._one_step import one_step
from ._run import kinds, Log
from ._runge_kutta import step, tableau_of
from ._settings import Settings
from ._system import HybridSystem


class Impacts(eqx.Module):
    """The impacts of a trajectory, in order.

    Under a transformation (`jit`, `vmap`, `grad`) the arrays keep a fixed length k; the
    first `count` entries are real, later times are inf and later states NaN.
    """

    #: (k,) s
    time: Float[Array, " k"]
    #: (k, n) state just before and just after
    before: Float[Array, "k n"]
    after: Float[Array, "k n"]
    #: (k,) which constraint was hit
    constraint: Int[Array, " k"]
    #: (k,) normal velocity before (negative) and after (positive)
    speed_before: Float[Array, " k"]
    speed_after: Float[Array, " k"]
    count: Int[Array, ""]


class Contacts(eqx.Module):
    """The intervals of sticking, in order of their start; padded as `Impacts` is.

    `start` is the accumulation time of the chatter (or t0), `end` the release; a
    contact that lasts beyond the trajectory has `released` False and ends at t1.
    """

    start: Float[Array, " m"]
    end: Float[Array, " m"]
    released: Bool[Array, " m"]
    constraint: Int[Array, " m"]
    count: Int[Array, ""]


class Steps(eqx.Module):
    """The points between which the motion was integrated, with their modes."""

    time: Float[Array, " s"]
    state: Float[Array, "s n"]
    #: (s, constraints) whether the constraint is in contact from here on
    contact: Bool[Array, "s constraints"]
    count: Int[Array, ""]


class Trajectory(eqx.Module):
    """A trajectory of a hybrid system on [t0, t1]."""

    system: HybridSystem
    settings: Settings
    t0: Float[Array, ""]
    t1: Float[Array, ""]
    impacts: Impacts
    contacts: Contacts
    steps: Steps
    #: index into `RESULTS`: 0 successful
    code: Int[Array, ""]

    @property
    def successful(self):
        """Whether the trajectory reached t1."""
        return self.code == 0

    @property
    def result(self) -> str:
        """A sentence when the run did not reach t1, else the empty string."""
        return message(int(self.code))

    @property
    def final(self) -> Float[Array, " n"]:
        """State at the end of the run."""
        return self.steps.state[self.steps.count - 1]

    def at(self, times) -> Float[Array, "times n"]:
        """State at each of `times` (s, shape `(times,)`), after any impact there.

        Each sample is one more step of the same method from the last point before it,
        so it is as accurate as the run itself and differentiable.

        **Raises:** `ValueError` for times outside [t0, t1].
        """
        times = jnp.asarray(times, dtype=jnp.float64)
        if times.ndim != 1:
            raise ValueError(
                f"times has shape {times.shape}; pass a vector, such as "
                "jnp.linspace(t0, t1, 100) or jnp.array([t])"
            )
        known = not is_traced((self, times))
        if known and times.size:
            low, high = float(times.min()), float(times.max())
            end = float(self.steps.time[self.steps.count - 1])
            room = 1e-12 * (1.0 + abs(end))
            if not (low >= float(self.t0) - room and high <= end + room):
                raise ValueError(
                    f"times reach from {low:g} to {high:g} s but the trajectory covers "
                    f"{float(self.t0):g} to {end:g} s"
                )
        if not known:
            return _sample(self.system, self.settings, self.steps, times)
        steps, padded = _padded(self.steps), _pad(times, np.nan)
        found = _sample(self.system, self.settings, steps, padded)
        return jnp.asarray(np.asarray(found)[: times.shape[0]])

    def gap(self, times):
        """Gap at each of `times`: shape `(times,)`, or `(times, m)` for m > 1."""
        times = jnp.asarray(times, dtype=jnp.float64)
        return _gaps(self.system, times, self.at(times))

    def stroboscopic(self, period=None, phase=0.0) -> Float[Array, "k n"]:
        """States at t0 + phase + k period, for a period (s) or the forcing's own.

        **Raises:** `ValueError` where the system has no period and none is given.
        """
        period = self.system.period if period is None else period
        if period is None:
            raise ValueError(
                "this system has no forcing period; pass one: stroboscopic(period=...)"
            )
        span = float(self.t1 - self.t0 - phase)
        number = int(span / float(period) * (1 + 1e-12)) + 1
        times = self.t0 + phase + jnp.arange(number, dtype=float) * period
        return self.at(jnp.minimum(times, self.t1))

    def section(self, function, direction: int = 0):
        """Crossings of a Poincare section `function(t, state) = 0`.

        **Arguments:** a smooth scalar function, and the direction of the crossings that
        count: +1 rising, -1 falling, 0 both. Crossings are looked for between the
        points of the integration, refined by Newton; two within one step are missed.

        **Returns:** times (s) and states, shapes `(k,)` and `(k, n)`.
        """
        return _section(self, function, direction)


def message(code: int) -> str:
    """The sentence of a result code."""
    items = (
        RESULTS.successful,
        RESULTS.running,
        RESULTS.step_failed,
        RESULTS.not_finite,
    )
    return RESULTS[items[code]]


class Parts(NamedTuple):
    """The padded pieces of a trajectory."""

    impacts: Impacts
    contacts: Contacts
    steps: Steps


def assemble(system, t0, t1, state, contact, log: Log, sizes: tuple[int, int]) -> Parts:
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
        jnp.where(real, jnp.minimum(end, t1), jnp.inf),
        real & (end < jnp.inf),
        jnp.where(real, column, 0).astype(jnp.int32),
        total,
    )
    return Parts(impacts, contacts, steps)


def _speeds(system, times, states, which, real):
    speeds = jax.vmap(lambda t, x: normal_velocity(system, t, x))(times, states)
    picked = jnp.take_along_axis(speeds, which[:, None], axis=1)[:, 0]
    return jnp.where(real, picked, jnp.nan)


@eqx.filter_jit
def _gaps(system, times, states):
    values = jax.vmap(lambda t, x: gaps(system, t, x))(times, states)
    return values[:, 0] if values.shape[1] == 1 else values


def _pad(array, fill):
    """`array` continued to a power of two, so that few lengths are compiled."""
    array = np.asarray(array)
    length = 64
    while length < array.shape[0]:
        length *= 2
    rest = [(0, length - array.shape[0])] + [(0, 0)] * (array.ndim - 1)
    return jnp.asarray(np.pad(array, rest, constant_values=fill))


def _padded(steps: Steps) -> Steps:
    return Steps(
        _pad(steps.time, np.inf),
        _pad(steps.state, np.nan),
        _pad(steps.contact, False),
        steps.count,
    )


@eqx.filter_jit
def _sample(system, settings: Settings, steps: Steps, times):
    system = system.prepared()
    n = steps.state.shape[1]
    functions = Functions(system, n)

    def one(t):
        found = jnp.searchsorted(steps.time, t, side="right").astype(jnp.int64) - 1
        k = jnp.clip(found, 0, steps.count.astype(jnp.int64) - 1)
        x = tuple(steps.state[k, i] for i in range(n))
        contact = tuple(steps.contact[k, i] for i in range(functions.m))
        start = steps.time[k]
        moved = advance(system, functions, settings, start, x, contact, t - start)
        return jnp.stack(moved)

    return jax.vmap(one)(times)


def advance(system, functions: Functions, settings: Settings, t, x, contact, h):
    """The state a time `h` after `(t, x)` in one mode, by one step."""
    moved = _move(system, functions, settings, t, x, contact, h)
    held = contact[0]
    for c in contact[1:]:
        held = held | c
    if functions.planar:
        moved = tuple(jnp.where(held, a, b) for a, b in zip(x, moved, strict=True))
    for _ in range(3):
        jets = functions.jets(t + h, moved, contact)
        frame = functions.frame(t + h, moved)
        moved = functions.onto(frame, jets, moved, contact)
    return moved


def _move(system, functions, settings, t, x, contact, h):
    if isinstance(settings.solver, diffrax.AbstractImplicitSolver):
        held = jnp.stack(contact)

        def field(s, y):
            return field_in_force(system, s, y, held)

        after, _ = one_step(
            settings.solver, settings.tolerance, field, t, jnp.stack(x), h
        )
        return tuple(after[i] for i in range(functions.n))
    tableau = tableau_of(settings.solver)
    moved, _, _ = step(tableau, lambda s, y: functions.field(s, y, contact), t, x, h)
    return moved


def _section(trajectory, function, direction):
    steps = trajectory.steps
    count = int(steps.count)
    times, states = steps.time[:count], steps.state[:count]
    # a point just before an impact is not in the steps: end every step from its start
    lengths = jnp.diff(times)
    tiny = 1e-12 * jnp.maximum(jnp.abs(times[1:]), 1e-300)
    ends = trajectory.at(jnp.maximum(times[1:] - tiny, times[:-1]))
    left = jax.vmap(function)(times[:-1], states[:-1])
    right = jax.vmap(function)(times[1:], ends)
    crossed = (left * right < 0) | ((right == 0) & (left != 0))
    crossed = crossed & ((right - left) * direction >= 0) & (lengths > 0)
    (index,) = jnp.nonzero(crossed)
    low, high = times[index], times[index + 1]
    f_low = left[index]
    t = (low + high) / 2
    for _ in range(60):
        value = jax.vmap(function)(t, trajectory.at(t))
        same = value * f_low > 0
        low, high = jnp.where(same, t, low), jnp.where(same, high, t)
        t = (low + high) / 2
    return t, trajectory.at(t)
