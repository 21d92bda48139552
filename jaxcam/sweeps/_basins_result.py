"""Basins of attraction and their properties."""

import json
from typing import NamedTuple

import numpy as np
import xarray

from ..tables import ShortTable
from ._grid import Grid
from .blocks import SWEEP


class Share(NamedTuple):
    """Fraction of the states that lead to an attractor, and its standard error."""

    share: float
    """The fraction, from 0 to 1."""
    stderr: float
    """Standard error of the fraction."""


class Basins:
    """The result of [`jaxcam.sweeps.basins`][].

    `dataset` has one dimension for each component of the state, with the variables
    `attractor` (the number of the attractor to which each state leads, -1 if the motion
    escapes to infinity, -2 if the simulation failed, -3 if the state is inadmissible),
    `impacts` and `turns` (see [`jaxcam.sweeps.attractors.Labels`][]). The variables
    `name` and `orbit` describe each attractor, along the dimension `number`.

    Examples:
        >>> from jaxcam import sweeps
        >>> cubic = sweeps.Map(lambda x, p: 1.5 * x - 0.5 * x**3)
        >>> found = sweeps.basins(cubic, sweeps.Grid([-1.0], [1.0], [10]))
        >>> [share.share for share in found.shares.values()]
        [0.5, 0.5]
    """

    def __init__(self, dataset: xarray.Dataset, grid: Grid):
        self.dataset = dataset
        self.grid = grid

    @property
    def attractor(self) -> np.ndarray:
        """Number of the attractor of each state, in the shape of the grid."""
        return self.dataset["attractor"].values

    @property
    def names(self) -> list[str]:
        """Name of each attractor: P(1,1), P(6,6) a, ..."""
        return [str(name) for name in self.dataset["name"].values]

    @property
    def labels(self) -> np.ndarray:
        """Impacts and periods of each attractor, as numbers, shape
        `(attractors, 2)`.
        """
        both = (self.dataset["orbit_impacts"], self.dataset["orbit_turns"])
        return np.stack([part.values for part in both], axis=1)

    @property
    def orbits(self) -> np.ndarray:
        """Points of each attractor, padded with NaN, shape
        `(attractors, points, n)`.
        """
        return self.dataset["orbit"].values

    @property
    def scale(self) -> np.ndarray:
        """Scale of the motions, by which differences between orbits are divided, shape
        `(n,)`.
        """
        return np.array(json.loads(self.dataset.attrs[SWEEP])["scale"])

    @property
    def shares(self) -> dict[str, Share]:
        """Fraction of the admissible states that lead to each attractor (basin
        stability).

        The standard error sqrt(p (1 - p) / N) is that for states drawn at random (Menck
        et al., Nature Physics 9, 2013). For a grid, it is an upper bound if the basins
        are larger than the cells.
        """
        number = self.attractor
        number = number[number != -3]
        found = {}
        words = {**dict(enumerate(self.names)), -1: "escaped", -2: "failed"}
        for k, word in words.items():
            p = float(np.mean(number == k)) if len(number) else 0.0
            if k >= 0 or p > 0:
                error = float(np.sqrt(p * (1 - p) / max(len(number), 1)))
                found[word] = Share(p, error)
        return found

    def __repr__(self) -> str:
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> ShortTable:
        """Return a table of the attractors with the sizes of their basins."""
        shape = " x ".join(map(str, self.grid.shape))
        sentence = f"Basins of {len(self.names)} attractors, {shape} states."
        headings = ("attractor", "fraction of states", "standard error")
        rows = [
            (name, f"{one.share:.1%}", f"{one.stderr:.1%}")
            for name, one in self.shares.items()
        ]
        return ShortTable(sentence, headings, rows, ("attractor",))
