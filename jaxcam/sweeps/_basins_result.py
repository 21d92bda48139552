"""Basins of attraction, and what can be read off them."""

import json
from typing import NamedTuple

import numpy as np
import xarray

from ._grid import Grid
from .blocks import SWEEP


class Share(NamedTuple):
    """Part of the states that end on an attractor, and its standard error."""

    share: float
    stderr: float


class Basins:
    """What [`jaxcam.sweeps.basins`][] returns.

    `dataset` has one dimension for each component of the state, and `attractor` (the
    number of the one that each state ends on, -1 if it escapes to infinity, -2 if it
    failed, -3 if it cannot start), `impacts` and `turns` (see
    [`jaxcam.sweeps.attractors.Labels`][]); along `number`, the attractors: `name` and
    `orbit`.
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
        """(attractors, 2) impacts and turns of each attractor, as numbers."""
        both = (self.dataset["orbit_impacts"], self.dataset["orbit_turns"])
        return np.stack([part.values for part in both], axis=1)

    @property
    def orbits(self) -> np.ndarray:
        """(attractors, points, n) points of each attractor, filled up with NaN."""
        return self.dataset["orbit"].values

    @property
    def scale(self) -> np.ndarray:
        """(n,) size of the motions, in whose units orbits are compared."""
        return np.array(json.loads(self.dataset.attrs[SWEEP])["scale"])

    @property
    def shares(self) -> dict[str, Share]:
        """Part of the states that can start which ends on each attractor.

        The standard error sqrt(p (1 - p) / N) is that of states drawn at random (Menck
        et al., Nature Physics 9, 2013); of a grid it is an upper bound where basins are
        larger than its cells.
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
        shape = " x ".join(map(str, self.grid.shape))
        parts = (f"{name} {share.share:.1%}" for name, share in self.shares.items())
        return f"Basins({shape}: {', '.join(parts)})"
