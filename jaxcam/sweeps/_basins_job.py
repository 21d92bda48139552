"""The blocks of a basin computation."""

import functools
from collections.abc import Callable

import numpy as np

from ._grid import Grid
from ._inputs import LANES
from .attractors import APERIODIC, cell_codes, fingerprint_size, fingerprints, settle
from .blocks import about_section, AbstractJob, Arrays, StoredVariable, StoreLayout
from .sections import AbstractSection


_FINE = 1 / 64
"""Extent, in units of the scale, of the cells that distinguish non-periodic motions."""


class BasinsJob(AbstractJob):
    """Computes the motions that start from some rows of the grid in each block."""

    def __init__(
        self,
        section: AbstractSection,
        grid: Grid,
        turns: int,
        keep: int,
        period_tolerance: float,
        same: float,
        reruns: int,
        scale: np.ndarray,
        block: int | None,
    ):
        self.section, self.grid, self.same, self.scale = section, grid, same, scale
        self.settings = (turns, keep, period_tolerance, reruns)
        n = len(grid.shape)
        row = int(np.prod(grid.shape[1:]))
        names = section.names(n)
        dims = tuple(name.replace(" ", "_") for name, _ in names)
        tail = grid.shape[1:]
        variables = {
            "impacts": StoredVariable(dims, tail, "int32"),
            "turns": StoredVariable(dims, tail, "int32"),
            "fingerprint": StoredVariable(
                (*dims, "mean"), (*tail, fingerprint_size(n)), "float64"
            ),
            # zero for periodic motions, so that the array compresses well
            "cells": StoredVariable((*dims, "sample"), (*tail, keep), "int64"),
        }
        coordinates = {
            dim: (dim, grid.centres(i), {"long_name": name, "units": unit})
            for i, (dim, (name, unit)) in enumerate(zip(dims, names, strict=True))
        }
        rows = max(1, LANES // row) if block is None else block
        rows = min(rows, grid.shape[0])
        identity = {
            "sweep": "basins",
            **about_section(section),
            "grid": {"low": grid.low, "high": grid.high, "shape": grid.shape},
            "turns": turns,
            "keep": keep,
            "period_tolerance": period_tolerance,
            "same": same,
            "reruns": reruns,
            "scale": scale.tolist(),
            "block": rows,
        }
        self.layout = StoreLayout(grid.shape[0], rows, variables, coordinates, identity)

    def work(self, block: int, before: Arrays | None) -> Callable[[], Arrays]:
        del before
        bounds = self.layout.bounds(block)
        return functools.partial(
            some_rows, self.section, self.grid, self.scale, bounds, *self.settings
        )


def default_scale(
    section: AbstractSection, grid: Grid, turns: int, keep: int
) -> np.ndarray:
    """Return the largest extent or coordinate of the grid in each component.

    For a component with a single cell, the largest value in a motion from the middle of
    the grid also counts.
    """
    low, high = np.array(grid.low), np.array(grid.high)
    found = np.maximum(grid.extents, np.maximum(np.abs(low), np.abs(high)))
    single = np.array(grid.shape) == 1
    if np.any(single):
        samples, _ = settle(section, (low + high)[None] / 2, turns, keep)
        states = np.abs(samples.states).reshape(-1, len(found))
        reach = np.max(np.where(np.isfinite(states), states, 0.0), axis=0)
        # rounded, because the scale is part of the identity of a stored sweep
        reach = np.array([float(f"{one:.1e}") for one in reach])
        found = np.where(single, np.maximum(found, reach), found)
    return np.where(found > 0, found, 1.0)


def some_rows(
    section, grid, scale, bounds, turns, keep, period_tolerance, reruns
) -> Arrays:
    """Compute the motions that start from some rows of the grid."""
    states = grid.states(*bounds)
    samples, labels = settle(
        section, states, turns, keep, period_tolerance=period_tolerance, reruns=reruns
    )
    origin = np.array(grid.low)
    cells = cell_codes(samples.states, origin, scale, _FINE)
    cells[labels.turns != APERIODIC] = 0
    print_ = fingerprints(samples.states, labels.turns, origin, scale)
    shape = (bounds[1] - bounds[0], *grid.shape[1:])
    return {
        "impacts": labels.impacts.reshape(shape),
        "turns": labels.turns.reshape(shape),
        "fingerprint": print_.reshape(*shape, -1),
        "cells": cells.reshape(*shape, keep),
    }
