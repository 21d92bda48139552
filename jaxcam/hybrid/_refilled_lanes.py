"""A group of lanes in fewer slots: one that ends makes room for the next."""

import jax
import jax.numpy as jnp
import numpy as np

from ._lane import FINISHED, RUNNING
from ._slots import compiled_look, start_lanes


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

    **Arguments:** the system, with `values` `(lanes,)` or `(lanes, k)` of what `where`
    picks, or neither; `states` `(lanes, n)` at `t0` (s); the number of `turns` of a
    `period` (s).
    `rows` attempts are made between two looks at who has ended, `max_steps` at most.
    `seen` takes the log, one `seen.row` an attempt, as it comes.

    **Returns:** impacts, attempts and result codes, each `(lanes,)`.
    """
    lanes = len(states)
    shape = t0, period, jnp.asarray(float(turns)), settings, width
    start = start_lanes(system, where, values, states, *shape)
    look, place = compiled_look(start, rows, seen.row), start.slots.rows
    ends = np.zeros((lanes, 3), dtype=int)
    # spread evenly, to learn what the others will cost; slots without a lane of their
    # own show the last one, and do not run
    first = np.linspace(0, lanes - 1, min(width, lanes)).astype(int)
    work, used = np.full(width, lanes - 1), np.zeros(width)
    work[: len(first)], running = first, np.arange(width) < lanes
    waiting, sorted_yet = np.setdiff1d(np.arange(lanes), first), False
    own, structure = jax.tree.flatten(start.own)
    numbers, mine = start.numbers[:, work], [leaf[work] for leaf in own]
    numbers[place.status, ~running] = FINISHED
    while np.any(running):
        numbers, log = look(structure.unflatten(mine), start.shared, numbers)
        seen.take(work, np.asarray(log))
        used += rows
        status = np.asarray(numbers)[place.status]
        over = running & ((status != RUNNING) | (used >= max_steps))
        if not np.any(over):
            continue
        numbers = np.array(numbers)
        counted = [place.status, place.impacts, place.steps]
        ends[work[over]] = numbers[counted].T[over]
        # who has used up the budget stays where it is
        numbers[place.status, over], running[over] = FINISHED, False
        if not sorted_yet:
            waiting = costly_first(waiting, work, used, numbers[place.stops])
            sorted_yet = True
        free = np.flatnonzero(over)[: len(waiting)]
        fresh, waiting = waiting[: len(free)], waiting[len(free) :]
        work[free], used[free], running[free] = fresh, 0, True
        numbers[:, free] = start.numbers[:, fresh]
        mine = [leaf[work] for leaf in own]
    codes = np.array([1, 0, 2, 3])[ends[:, 0]]
    return ends[:, 1], ends[:, 2], codes


def costly_first(waiting, work, used, stops):
    """The waiting lanes, those first that will take most attempts.

    A lane that starts last and takes long leaves the other slots empty. Lanes that are
    neighbours cost alike, so those at work tell: attempts over turns so far.
    """
    order = np.argsort(work, kind="stable")
    each = used[order] / np.maximum(stops[order], 0.5)
    expected = np.interp(waiting, work[order], each)
    return waiting[np.argsort(-expected, kind="stable")]
