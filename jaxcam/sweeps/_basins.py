"""Basins of attraction: which states lead to which attractor."""

from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from ._basins_job import BasinsJob, default_scale
from ._basins_result import Basins
from ._grid import Grid
from ._inputs import as_section, check_regular, check_turns
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
    """Compute basins of attraction: the attractor to which each state of a grid leads.

    Motions are simulated and sampled once per period. Periodic motions are on the same
    attractor if their orbits are equal; other motions are on the same attractor if they
    visit at least one cell of state space in common. The result does not depend on the
    order of the states, on the blocks or on the executor.

    Args:
        system: A hybrid system, or a section that is sampled once per period.
        grid: A [`jaxcam.sweeps.Grid`][] of initial states; those with a negative gap
            are omitted.
        turns: Number of periods simulated.
        keep: Number of final samples used; periods up to `keep / 2` are detected.
        period_tolerance: Tolerance for detecting periods.
        same: Orbits that differ by less than this value, in units of `scale`, count as
            the same attractor.
        reruns: Number of extensions of non-periodic runs, each twice as long as the
            previous one.
        scale: Scale of the motions, shape `(n,)`; default: the largest extent or
            coordinate of the grid (for a component with a single cell, also of a
            motion), or the scale of `known`. The scale matters if the
            grid is small compared with the attractors.
        known: Basins of the same system whose attractor numbers are to be kept, for
            example when zooming in.
        out: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        resume: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        executor: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        workers: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        progress: As for [`jaxcam.sweeps.blocks.run_blocks`][].
        block: Number of rows of the grid, along the first component, that are computed
            together.

    Returns:
        A [`jaxcam.sweeps.Basins`][].

    Raises:
        ValueError: An argument is invalid; the message says how to fix it.
        RuntimeError: Workers were lost.

    Examples:
        >>> from jaxcam import sweeps
        >>> cubic = sweeps.Map(lambda x, p: 1.5 * x - 0.5 * x**3)
        >>> found = sweeps.basins(cubic, sweeps.Grid([-1.0], [1.0], [10]))
        >>> len(found.names)
        2
    """
    section = as_section(system)
    check_turns(turns, keep, period_tolerance, reruns)
    check_regular(section, "basins need")
    if not 0 < same < 1:
        raise ValueError(f"same is {same:g}; give a number in (0, 1), such as 1e-3")
    if block is not None and block < 1:
        raise ValueError(f"block is {block}; give 1 or more rows of the grid")
    if scale is None:
        scale = (
            known.scale
            if known is not None
            else default_scale(section, grid, turns, keep)
        )
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
