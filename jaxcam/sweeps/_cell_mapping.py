"""Simple cell mapping: basins from one period per cell (Hsu; thesis, section 5.3.1)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ._grid import Grid
from ._inputs import as_section, LANES


class CellMapping(NamedTuple):
    """The destination of each cell of a grid, in the shape of the grid."""

    group: np.ndarray
    """Index of the group to which each cell leads; -1 for the sink cell."""
    period: np.ndarray
    """Number of cells in the cycle to which each cell leads; 0 for the sink cell."""
    steps: np.ndarray
    """Number of iterations of the map until the cycle is reached."""
    cyclic: np.ndarray
    """Whether each cell is part of a cycle."""


def cell_mapping(
    system,
    grid: Grid,
    *,
    turns: int = 1,
    progress: Callable[[float], None] | None = None,
) -> CellMapping:
    """Map the centre of each cell, and follow the resulting sequences of cells (simple
    cell mapping).

    All states outside the grid and all inadmissible states form one sink cell, which
    maps to itself. The method is an approximation, in which a cycle of small cells
    represents an attractor. Groups are numbered in the order of their first cells (Hsu,
    Global analysis by cell mapping, 1992). [`jaxcam.sweeps.basins`][], in contrast,
    simulates each motion.

    Args:
        system: A hybrid system, or a section that is sampled once per period.
        grid: A [`jaxcam.sweeps.Grid`][] of states.
        turns: Number of periods per iteration of the map.
        progress: Called with the fraction of cells completed.

    Returns:
        A `CellMapping`.

    Raises:
        ValueError: The section is not sampled once per period, or `turns` is less than
            one.

    Examples:
        >>> from jaxcam import sweeps
        >>> cubic = sweeps.Map(lambda x, p: 1.5 * x - 0.5 * x**3)
        >>> sweeps.cell_mapping(cubic, sweeps.Grid([-1.5], [1.5], [30])).group.shape
        (30,)
    """
    section = as_section(system)
    if not section.regular or turns < 1:
        raise ValueError(
            "cell mapping needs a section that is sampled once per period, and turns "
            "of at least 1"
        )
    states = grid.states()
    images = []
    for first in range(0, len(states), LANES):
        samples = section.sample(states[first : first + LANES], turns, 1)
        image = grid.cells(samples.final)
        image[samples.code != 0] = -1
        images.append(image)
        if progress is not None:
            progress(min(1.0, (first + LANES) / len(states)))
    return follow_cells(np.concatenate(images), grid.shape)


def follow_cells(image, shape) -> CellMapping:
    """Return the groups of cells that lead to the same cycle.

    **Arguments:** `image`: the image of each cell, -1 for the sink.
    """
    image = np.asarray(image)
    count = len(image)
    # the sink is an additional cell at the end
    pointer = np.append(np.where(image < 0, count, image), count)
    doublings = max(1, int(count + 1).bit_length())
    far, smallest = pointer.copy(), np.minimum(np.arange(count + 1), pointer)
    for _ in range(doublings):
        smallest = np.minimum(smallest, smallest[far])
        far = far[far]
    # after this many iterations, every cell has reached a cycle, identified by its
    # smallest cell
    cyclic = np.zeros(count + 1, dtype=bool)
    cyclic[far] = True
    name = smallest[far]
    length = np.bincount(name[cyclic], minlength=count + 1)
    sink = name == count
    used = np.unique(name[~sink])
    group = np.where(sink, -1, np.searchsorted(used, name))
    period = np.where(sink, 0, length[name])
    parts = (group, period, _steps(pointer, cyclic), cyclic)
    return CellMapping(*(part[:-1].reshape(shape) for part in parts))


def _steps(pointer, cyclic):
    """Return the number of iterations until each cell reaches a cycle, by doubling."""
    steps = np.where(cyclic, 0, 1)
    far = np.where(cyclic, np.arange(len(pointer)), pointer)
    while True:
        more = steps + steps[far]
        if np.array_equal(more, steps):
            return steps
        steps, far = more, far[far]
