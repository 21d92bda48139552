"""Convert the log of a run to impacts, contacts and steps."""

from types import ModuleType
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from .._switched import SwitchedSystem
from ..backend import Rowwise
from ..codes import RowKind
from ..loop import Log, rows_of_kind
from ..programs import program
from ..surface import normal_velocity, surfaces
from ._events import Contacts, Impacts, Steps, Switches


class Parts(NamedTuple):
    """The parts of a trajectory, each padded to a fixed length."""

    impacts: Impacts
    contacts: Contacts
    steps: Steps
    switches: Switches | None


def assemble(
    system,
    t0,
    state,
    mode,
    log: Log,
    sizes: tuple[int, int] | None,
    xp: ModuleType = jnp,
    *,
    compiles: bool = False,
) -> Parts:
    """Sort the rows of a log into impacts, contacts, steps and crossings; `mode`
    contains the flags at the start.

    Impacts and crossings are padded to the first of the `sizes`, and contacts to the
    second. With `xp=numpy`, a log that is not traced is sorted without compilation, and
    without `sizes`, nothing is padded. Functions of the system are then compiled by
    LLVM if `compiles` is true.
    """
    rows = log.kind.shape[0]
    k = _surfaces(system, t0, state)
    m = mode.shape[0] - 2 * k
    valid = log.kind > 0
    order = _places(xp, valid, rows, rows)
    count = xp.sum(valid)

    def first(start, rest, fill):
        padded = xp.concatenate([rest, xp.full_like(rest[:1], fill)])
        return xp.concatenate([start[None], padded[order]])

    time = first(t0, log.t, xp.inf)
    kept = first(mode, log.mode > 0.5, False)
    sides = _sides(xp, kept[:, m : m + k], kept[:, m + k :]) if k else None
    kept = kept[:, :m] if k else kept
    steps = Steps(time, first(state, log.after, xp.nan), kept, count + 1, sides)
    of_events, of_contacts = (None, None) if sizes is None else sizes
    switches = _switches(xp, log, m, of_events, system.one_way) if k else None
    if not m:
        return Parts(*_nothing(xp, state, log), steps, switches)
    impacts = _impacts(xp, system, log, of_events, compiles)
    contacts = _contacts(xp, time, kept, count, of_contacts)
    return Parts(impacts, contacts, steps, switches)


def _sides(xp: ModuleType, negative, sliding):
    """Return the sides of the surfaces, +1 or -1, or 0 while the motion slides."""
    return xp.where(sliding, 0.0, xp.where(negative, -1.0, 1.0))


def _surfaces(system, t0, state) -> int:
    """Return the number of switching surfaces of a system."""
    if not isinstance(system, SwitchedSystem):
        return 0
    made = jax.eval_shape(lambda t, x: surfaces(system, t, x), t0, state)
    return made.shape[0]


def _nothing(xp: ModuleType, state, log: Log) -> tuple[Impacts, Contacts]:
    """Return the impacts and contacts of a system without constraints: none."""
    none = xp.zeros((0,))
    states = xp.zeros((0, state.shape[0]))
    which = xp.zeros((0,), dtype=xp.int32)
    count = xp.sum(log.kind < 0)
    impacts = Impacts(none, states, states, which, none, none, count)
    return impacts, Contacts(none, none, none > 0, which, count)


def _switches(
    xp: ModuleType, log: Log, m: int, size: int | None, one_way: int
) -> Switches:
    """Return the events at switching surfaces, which the log numbers from `m` on; the
    first ones are `one_way` transitions, whose guards fall.
    """
    crossed = rows_of_kind(log, RowKind.SWITCH, RowKind.SLIDE, RowKind.LEAVE)
    number = xp.sum(crossed)
    size = int(number) if size is None else size
    index = _places(xp, crossed, size, 0)
    real = xp.arange(size) < number
    which = xp.where(real, log.constraint[index] - m, 0.0).astype(xp.int32)
    negative = xp.take_along_axis(log.mode[index], m + which[:, None], axis=1)[:, 0]
    falls = (negative > 0.5) | (which < one_way)
    return Switches(
        xp.where(real, log.t[index], xp.inf),
        xp.where(real[:, None], log.before[index], xp.nan),
        xp.where(real[:, None], log.after[index], xp.nan),
        which,
        xp.where(real, xp.where(falls, -1.0, 1.0), xp.nan),
        number,
        xp.where(real, log.kind[index] - float(RowKind.SWITCH), 0.0).astype(xp.int32),
    )


def _impacts(
    xp: ModuleType, system, log: Log, size: int | None, compiles: bool
) -> Impacts:
    hits = rows_of_kind(log, RowKind.IMPACT, RowKind.LAST_IMPACT)
    number = xp.sum(hits)
    size = int(number) if size is None else size
    index = _places(xp, hits, size, 0)
    real = xp.arange(size) < number
    t_hit = xp.where(real, log.t[index], xp.inf)
    before = xp.where(real[:, None], log.before[index], xp.nan)
    after = xp.where(real[:, None], log.after[index], xp.nan)
    which = xp.where(real, log.constraint[index], 0.0).astype(xp.int32)
    sides = log.before[index], log.after[index]
    speeds = _speeds(xp, system, log.t[index], sides, which, compiles)
    hit, left = (xp.where(real, speed, xp.nan) for speed in speeds)
    return Impacts(t_hit, before, after, which, hit, left, number)


def _contacts(xp: ModuleType, time, kept, count, size: int | None) -> Contacts:
    rows = time.shape[0] - 1
    # a contact begins in the row after its last impact and ends where its flag is
    # cleared
    began = xp.concatenate([kept[:1], kept[1:] & ~kept[:-1]])
    fell = xp.concatenate([xp.zeros_like(kept[:1]), kept[:-1] & ~kept[1:]])
    fell = fell & (xp.arange(rows + 1) <= count)[:, None]
    reached = time[count]
    ends = _least_to_come(xp, xp.where(fell, time[:, None], xp.inf))
    later = xp.concatenate([time[1:], xp.full_like(time[:1], xp.inf)])
    starts = xp.where(xp.arange(rows + 1) == 0, time, later)
    width = kept.shape[1]
    # a contact that would begin after the last row does not begin
    total = xp.sum(began & (starts[:, None] < xp.inf))
    size = int(xp.sum(began)) if size is None else size
    flat = _places(xp, began.ravel(), size, 0)
    row, column = flat // width, flat % width
    real = xp.arange(size) < total
    end = ends[row, column]
    return Contacts(
        xp.where(real, starts[row], xp.inf),
        xp.where(real, xp.minimum(end, reached), xp.inf),
        real & (end < xp.inf),
        xp.where(real, column, 0).astype(xp.int32),
        total,
    )


def _places(xp: ModuleType, mask, size: int, fill: int):
    """Return the first `size` indices at which a mask is true, padded with `fill`."""
    if xp is jnp:
        return jnp.nonzero(mask, size=size, fill_value=fill)[0]
    found = np.flatnonzero(mask)[:size]
    return np.pad(found, (0, size - len(found)), constant_values=fill)


def _least_to_come(xp: ModuleType, values):
    """Return the smallest of each entry and all later ones, along the first axis."""
    if xp is jnp:
        return jax.lax.cummin(values, axis=0, reverse=True)
    return np.minimum.accumulate(values[::-1])[::-1]


def _speeds(xp: ModuleType, system, times, sides, which, compiles: bool):
    """Return the normal velocities at the constraints that were hit, before and after
    the impacts.
    """
    count = times.shape[0]
    if xp is np and not count:
        return times, times
    points = times, *sides, which
    if xp is np:
        return _SPEEDS(system, points, count, compiles=compiles)
    return _speeds_of(system, points)


def _speeds_at(system, point):
    t, before, after, which = point
    return tuple(normal_velocity(system, t, x)[which] for x in (before, after))


_SPEEDS = Rowwise(_speeds_at)


@program
def _speeds_of(system, points):
    return jax.vmap(lambda point: _speeds_at(system, point))(points)
