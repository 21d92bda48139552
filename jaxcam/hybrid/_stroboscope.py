"""Many trajectories at once, sampled once a period."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..parameters import as_arrays, pick, real_array, Where
from ._settings import Settings
from ._system import HybridSystem
from .batch import Chunking, Horizon, Lanes, run_refilled, split_lanes, TurnSamples
from .checks import check_start, refuse_tracers
from .loop import starts_behind
from .surface import check_restitution, restitutions


# lanes of a group over lanes of a block
_GROUP = 64


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
    where: Where | None = None,
    values=None,
    period: float | None = None,
    settings: Settings | None = None,
    block: int = 128,
    rows: int = 64,
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

    **Returns:** a `Stroboscope`.

    **Raises:** `ValueError` where shapes do not fit, or there is no period.
    """
    refuse_tracers(
        "stroboscope", "jaxcam.hybrid.flow", system, states, values, t0, period
    )
    settings = (
        Settings(tolerance=1e-9, chatter_depth=1.0) if settings is None else settings
    )
    settings.check()
    system = as_arrays(system)
    settings = as_arrays(settings)
    states = np.asarray(real_array(states, "states"))
    values = None if values is None else np.asarray(values, dtype=float)
    lanes = (
        states.shape[0] if states.ndim == 2 else (1 if values is None else len(values))
    )
    if states.ndim == 1:
        states = np.broadcast_to(states, (lanes, states.shape[0]))
    where = None if where is None else pick(where, system)
    several = (len(where.leaves),) if where is not None and where.several else ()
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
    _check(*split_lanes(system, where, values), settings, start, length, states)

    # a group keeps its block busy until its last lanes, and bounds the memory
    width = min(block, lanes)
    shares = -(-lanes // (workers * width))
    group = width * min(_GROUP, shares)

    all_lanes = Lanes(system, where, values, states)

    def work(first):
        some = all_lanes.some(slice(first, first + group))
        seen = TurnSamples(len(some.states), turns, skip, states.shape[1])
        chunking = Chunking(width, rows, max_steps)
        ends = run_refilled(
            some, Horizon(start, length, turns), settings, chunking, seen.table
        )
        return seen.states, *ends, *seen.counts()

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

    seen = _starts(batched, shared, period, t0, jnp.asarray(states))
    nearest, behind, lengths, returned = map(np.asarray, seen)
    if not np.all(lengths > 0):
        raise ValueError(
            "the period of a lane is not positive; check values and period"
        )
    check_restitution(first, returned)
    if not np.all(np.isfinite(nearest)):
        raise ValueError("the gap is not finite at t0; check states and parameters")
    if np.any(behind):
        lane = int(np.argmin(np.where(behind, nearest, np.inf)))
        raise ValueError(
            f"gap is negative ({float(nearest[lane]):.1e}) at t0 in lane {lane}; "
            "start outside the constraint"
        )


@eqx.filter_jit
def _starts(batched, shared, period, t0, states):
    """Of each lane: smallest gap, whether it is behind, period, restitution."""

    def one(batched, state):
        system = eqx.combine(batched, shared)
        length = system.period if period is None else period
        behind, values = starts_behind(system, t0, state)
        length = jnp.asarray(length, dtype=jnp.float64)
        return jnp.min(values), behind, length, restitutions(system, t0, state)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)
