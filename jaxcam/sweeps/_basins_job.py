"""The blocks of a basin computation."""

import functools
from collections.abc import Callable

import numpy as np

from ._grid import Grid
from ._inputs import LANES
from .attractors import APERIODIC, cell_codes, fingerprint_size, fingerprints, settle
from .blocks import about_section, AbstractJob, Arrays, StoredVariable, StoreLayout
from .sections import AbstractSection


# Number of motions that determine the scale of a component with a single cell
_TRIED = 8
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

    For a component with a single cell, the largest value in a few motions from the grid
    also counts, except in motions that diverge or rotate.
    """
    low, high = np.abs(grid.low), np.abs(grid.high)
    found = np.maximum(grid.extents, np.maximum(low, high))
    single = np.array(grid.shape) == 1
    if np.any(single) and keep > 1:
        found = np.where(
            single, np.maximum(found, _reach(section, grid, turns, keep)), found
        )
    return np.where(found > 0, found, 1.0)


def _reach(section: AbstractSection, grid: Grid, turns: int, keep: int) -> np.ndarray:
    """Return the largest values in a few bounded motions, shape `(n,)`; zero if there
    is none. They are rounded to powers of two, because they become part of the identity
    of a stored sweep.
    """
    states = grid.states()
    some = np.linspace(0, len(states) - 1, min(_TRIED, len(states))).astype(int)
    kept = settle(section, states[some], turns, keep)[0].states
    middles = [np.median(half, axis=1) for half in np.array_split(kept, 2, axis=1)]
    drift = np.abs(middles[1] - middles[0])
    bounded = np.isfinite(drift) & (drift <= np.ptp(kept, axis=1) / 2)
    reach = np.max(np.where(bounded, np.max(np.abs(kept), axis=1), 0.0), axis=0)
    with np.errstate(divide="ignore"):
        return 2.0 ** np.round(np.log2(reach))


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
