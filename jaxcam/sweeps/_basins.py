"""Basins of attraction: which states end on which attractor."""

from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from ._basins_job import BasinsJob, default_scale
from ._basins_result import Basins
from ._grid import Grid
from ._inputs import as_section, check_turns
from ._together import together
from .blocks import Progress, run_blocks


def basins(
    system,
    grid: Grid,
    turns: int = 100,
    *,
    keep: int = 24,
    period_tolerance: float = 1e-6,
    same: float = 1e-3,
    reruns: int = 1,
    scale=None,
    known: Basins | None = None,
    out: str | Path | None = None,
    resume: bool = False,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: Callable[[Progress], None] | None = None,
    block: int | None = None,
) -> Basins:
    """Which attractor each state of a grid ends on.

    Motions are followed and looked at once a turn. Those that repeat are on the same
    attractor where their orbits agree; those that do not are where they visit common
    cells. Neither depends on the order of states, on blocks, or on the executor.

    Args:
        system: A hybrid system, or a section that is taken once a turn.
        grid: A [`jaxcam.sweeps.Grid`][] of initial states; those behind the constraint
            are left out.
        turns: How many are simulated, of which the last `keep` are looked at; periods
            up to `keep / 2` are found.
        period_tolerance: For finding periods.
        same: Orbits that differ by less, in units of `scale`, are one.
        reruns: How often motions that do not repeat yet go on, each time for twice as
            many turns.
        scale: Size of the motions, shape `(n,)`; without, the largest extent or
            coordinate of the grid, or the scale of `known`. It matters for a grid that
            is small beside the attractors.
        known: Basins of the same system whose attractors keep their numbers here, for
            example when zooming in.
        out: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        resume: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        executor: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        workers: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        progress: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        block: Rows of the grid's first component that are computed together.

    Returns:
        [`jaxcam.sweeps.Basins`][].

    Raises:
        ValueError: That names the fix.
        RuntimeError: Where workers were lost.
    """
    section = as_section(system)
    check_turns(turns, keep, period_tolerance, reruns)
    if not section.regular:
        raise ValueError(
            f"basins need a section that is taken once a turn; a "
            f"{type(section).__name__} is not, so pass the system itself"
        )
    if not 0 < same < 1:
        raise ValueError(f"same is {same:g}; give a number in (0, 1), such as 1e-3")
    if block is not None and block < 1:
        raise ValueError(f"block is {block}; give 1 or more rows of the grid")
    if scale is None:
        scale = known.scale if known is not None else default_scale(grid)
    scale = np.asarray(scale, dtype=float)
    if scale.shape != (len(grid.shape),) or not np.all(scale > 0):
        raise ValueError(
            f"scale is {scale}; give a positive number for each of {len(grid.shape)} "
            "components"
        )
    job = BasinsJob(
        section, grid, turns, keep, period_tolerance, same, reruns, scale, block
    )
    store = run_blocks(
        job,
        out=out,
        resume=resume,
        executor=executor,
        workers=workers,
        progress=progress,
    )
    store.add(together(job, store, known))
    return Basins(store.dataset(), grid)
