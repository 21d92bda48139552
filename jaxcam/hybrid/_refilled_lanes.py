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
    `seen` takes the log, one `seen.row` an attempt, as it comes.
    """
    lanes = len(states)
    shape = t0, period, jnp.asarray(float(turns)), settings, width
    start = start_lanes(system, where, values, states, *shape)
    look, place = compiled_look(start, rows, seen.row), start.slots.rows
    ends = np.zeros((lanes, 3), dtype=int)
    # slots without a lane of their own show the last one, and do not run
    work, used = np.minimum(np.arange(width), lanes - 1), np.zeros(width)
    running, waiting = np.arange(width) < lanes, min(width, lanes)
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
        free = np.flatnonzero(over)[: lanes - waiting]
        fresh = np.arange(waiting, waiting + len(free))
        work[free], used[free], running[free] = fresh, 0, True
        waiting += len(free)
        numbers[:, free] = start.numbers[:, fresh]
        mine = [leaf[work] for leaf in own]
    codes = np.array([1, 0, 2, 3])[ends[:, 0]]
    return ends[:, 1], ends[:, 2], codes
