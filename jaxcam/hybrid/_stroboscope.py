"""Simulate many trajectories and sample them once per period."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from ..parameters import as_arrays, pick, real_array, Where
from ..tables import ShortTable
from ._settings import Settings
from ._system import HybridSystem
from .batch import Chunking, Horizon, Lanes, run_refilled, split_lanes, TurnSamples
from .checks import check_start, refuse_tracers
from .codes import message
from .loop import starts_behind
from .programs import program
from .record import Printed, vector_text
from .surface import check_restitution, restitutions


# ratio of the number of trajectories in a group to that in a block
_GROUP = 64
# on a GPU, which runs very many trajectories at once, a group has so many trajectories
# that their samples consist of about this many numbers
_ON_GPU = 2**27


class Stroboscope(Printed):
    """Stroboscopic samples of many trajectories, as NumPy arrays; NaN where a run
    failed.
    """

    states: np.ndarray
    """States at t0 + k period, k = skip + 1..turns, shape `(trajectories, turns - skip,
    n)`.
    """
    impacts: np.ndarray
    """Number of impacts of each trajectory, shape `(trajectories,)`."""
    steps: np.ndarray
    """Number of attempted integration steps, shape `(trajectories,)`."""
    code: np.ndarray
    """Index into `RESULTS`, shape `(trajectories,)`; 0 if the trajectory reached its
    end.
    """
    hits: np.ndarray
    """Impacts in each sampled period, shape `(trajectories, turns - skip)`."""
    rests: np.ndarray
    """Completed chatter sequences in each sampled period, in the shape of `hits`."""

    def _table(self) -> ShortTable:
        failed = int(np.count_nonzero(self.code))
        rows = [
            (
                str(k),
                str(impacts),
                str(steps),
                vector_text(states[-1]),
                message(int(code)),
            )
            for k, (states, impacts, steps, code) in enumerate(
                zip(self.states, self.impacts, self.steps, self.code, strict=True)
            )
        ]
        headings = (
            "trajectory",
            "impacts",
            "steps",
            "last sample",
            "failure",
        )
        said = (
            f"trajectories: {len(rows)}, failed: {failed}, "
            f"samples of each: {self.states.shape[1]}"
        )
        # the column of failures is shown only if a trajectory has failed
        if not failed:
            headings, rows = headings[:-1], [row[:-1] for row in rows]
        return ShortTable(said, headings, rows, ("failure",))


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
    """Simulate many trajectories for `turns` periods and sample each once per period.

    Args:
        system: The system; all trajectories share it unless `where` is given.
        states: Initial states, shape `(trajectories, n)` with one row per trajectory,
            or `(n,)` if all start from the same state.
        turns: Number of periods.
        skip: Number of periods at the start that are not sampled.
        t0: Start time (s).
        where: Selects the parameter that differs between trajectories
            (`lambda s: s.speed`, or its dotted name), or several.
        values: Value of that parameter in each trajectory, shape `(trajectories,)` or
            `(trajectories, k)`.
        period: Sampling period (s); default: the system's forcing period.
        settings: Accuracy settings; the default completes chatter as soon as the theory
            allows.
        block: Number of trajectories advanced together; a trajectory that ends is
            replaced by the next one.
        rows: Number of attempted steps between two checks for ended trajectories.
        max_steps: Maximum number of attempted steps per trajectory.
        workers: Number of threads; results do not depend on it.
        progress: Called with the fraction of trajectories completed.

    Returns:
        A `Stroboscope` of NumPy arrays.

    Raises:
        ValueError: Shapes do not match, or there is no period.

    Examples:
        >>> from jaxcam.hybrid import stroboscope
        >>> from jaxcam.models import ImpactOscillator
        >>> stroboscope(ImpactOscillator(), jnp.zeros((3, 2)), 4, skip=2).states.shape
        (3, 2, 2)
    """
    refuse_tracers(
        "stroboscope", "jaxcam.hybrid.flow", system, states, values, t0, period
    )
    settings = (
        Settings(tolerance=1e-9, chatter_depth=1.0) if settings is None else settings
    )
    settings.check()
    system, settings = as_arrays(system), as_arrays(settings)
    values = None if values is None else np.asarray(values, dtype=float)
    states = _one_for_each(np.asarray(real_array(states, "states")), values)
    lanes = len(states)
    where = None if where is None else pick(where, system)
    several = (len(where.leaves),) if where is not None and where.several else ()
    if (where is None) != (values is None) or (
        values is not None and values.shape != (lanes, *several)
    ):
        raise ValueError(
            "give where and values together, with one value for each of the "
            f"{lanes} trajectories"
        )
    length = None if period is None else jnp.asarray(period, dtype=jnp.float64)
    _check_times(system, period, turns, skip)
    if not lanes:
        return _no_trajectories(turns - skip, states.shape[1])
    start = jnp.asarray(t0, dtype=jnp.float64)
    _check(*split_lanes(system, where, values), settings, start, length, states)

    width = min(block, lanes)
    samples = (turns - skip + 1) * (states.shape[1] + 2)
    group = _group(lanes, width, workers, _ON_GPU // samples if settings.on_gpu else 0)
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


def _group(lanes: int, width: int, workers: int, least: int) -> int:
    """Return the number of trajectories in a group, at least `least`.

    The size of a group limits the memory required. Within a group, the block stays full
    until only the last trajectories remain.
    """
    shares = -(-lanes // (workers * width))
    return max(width * min(_GROUP, shares), least)


def _one_for_each(states, values) -> np.ndarray:
    """Return one initial state for each trajectory, shape `(trajectories, n)`."""
    if states.ndim != 1:
        return states
    return np.broadcast_to(states, (1 if values is None else len(values), len(states)))


def _no_trajectories(samples: int, n: int) -> Stroboscope:
    counts, sampled = np.zeros(0, int), np.zeros((0, samples), int)
    states = np.zeros((0, samples, n))
    return Stroboscope(states, counts, counts, counts, sampled, sampled)


def _check_times(system, period, turns, skip) -> None:
    if period is None and system.period is None:
        raise ValueError(
            "this system has no forcing period; pass period=... in seconds"
        )
    if turns < 1:
        raise ValueError(f"turns is {turns}; give the number of periods, 1 or more")
    if not 0 <= skip < turns:
        raise ValueError(
            f"skip is {skip}; give 0 or more, and less than the {turns} periods"
        )


def _check(batched, shared, settings, t0, period, states) -> None:
    """Raise `ValueError` if a trajectory cannot start; only the first is checked in
    full.
    """
    first = eqx.combine(jax.tree.map(lambda leaf: leaf[0], batched), shared)
    one = jnp.asarray(states[0])
    check_start(first, settings, t0, one, t0)
    if not np.all(np.isfinite(states)):
        raise ValueError("a state is not finite; all components must be finite")

    seen = _starts(batched, shared, period, t0, jnp.asarray(states))
    nearest, behind, lengths, returned = map(np.asarray, seen)
    if not np.all(lengths > 0):
        raise ValueError(
            "the period of a trajectory is not positive; check values and period"
        )
    check_restitution(first, returned)
    if not np.all(np.isfinite(nearest)):
        raise ValueError("the gap is not finite at t0; check states and parameters")
    if np.any(behind):
        lane = int(np.argmin(np.where(behind, nearest, np.inf)))
        raise ValueError(
            f"gap is negative ({float(nearest[lane]):.1e}) at t0 in trajectory {lane}; "
            "start with every gap at zero or above"
        )


@program
def _starts(batched, shared, period, t0, states):
    """Return, per trajectory, the smallest gap, whether the start penetrates a
    constraint, the period and the coefficients of restitution.
    """

    def one(batched, state):
        system = eqx.combine(batched, shared)
        length = system.period if period is None else period
        behind, values = starts_behind(system, t0, state)
        length = jnp.asarray(length, dtype=jnp.float64)
        least = jnp.min(values) if values.size else jnp.zeros(())
        return least, behind, length, restitutions(system, t0, state)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)
