"""A bifurcation diagram, and what can be read off it."""

from typing import NamedTuple

import numpy as np
import xarray

from .attractors import label_names, Labels


class Range(NamedTuple):
    """Neighbouring values of the parameter with motions of one label."""

    label: str
    low: float
    high: float
    direction: int
    """1 for values gone through upwards, -1 downwards, 0 where each begins anew."""


class Diagram:
    """What [`jaxcam.sweeps.diagram`][] returns.

    `dataset` has the dimensions point (a value of the parameter, in the order in which
    they were gone through), start, sample and component, and the variables `state`,
    `hits` (impacts since the sample before), `impacts` and `turns` (the label, see
    [`jaxcam.sweeps.attractors.Labels`][]), `code` (0, or why a motion failed), and,
    where samples are not a turn apart, `time` (s) and `phase` (turns, from 0 to 1).
    """

    def __init__(self, dataset: xarray.Dataset):
        self.dataset = dataset

    @property
    def parameter(self) -> str:
        """Name of the parameter that varies."""
        roles = {n: c.attrs.get("role") for n, c in self.dataset.coords.items()}
        return next(str(name) for name, role in roles.items() if role == "parameter")

    @property
    def values(self) -> np.ndarray:
        """(points,) values of the parameter."""
        return self.dataset[self.parameter].values

    @property
    def states(self) -> np.ndarray:
        """(points, starts, keep, n) the points that motions settled on."""
        return self.dataset["state"].values

    @property
    def direction(self) -> np.ndarray:
        """(points,) 1 for values gone through upwards, -1 downwards, else 0."""
        return self.dataset["direction"].values

    @property
    def labels(self) -> np.ndarray:
        """(points, starts) labels in words, such as P(1,1) or P(inf,1)."""
        numbers = Labels(self.dataset["impacts"].values, self.dataset["turns"].values)
        return label_names(numbers)

    def ranges(self, start: int = 0) -> list[Range]:
        """The labels in order, each with the values over which it was met.

        **Arguments:** `start`: which of several starts.
        """
        found: list[Range] = []
        labels = self.labels[:, start]
        for label, value, way in zip(labels, self.values, self.direction, strict=True):
            value, way = float(value), int(way)
            last = found[-1] if found else None
            if last is not None and (last.label, last.direction) == (label, way):
                low, high = min(last.low, value), max(last.high, value)
                found[-1] = last._replace(low=low, high=high)
            else:
                found.append(Range(str(label), value, value, way))
        return found

    def __repr__(self) -> str:
        points, starts, keep, _ = self.dataset["state"].shape
        return (
            f"Diagram({self.parameter}: {points} values, {starts} starts, {keep} kept)"
        )
