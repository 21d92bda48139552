"""A bifurcation diagram and its properties."""

from typing import NamedTuple

import numpy as np
import xarray

from ..tables import ShortTable
from .attractors import APERIODIC, drifting, label_names, Labels


class Range(NamedTuple):
    """Neighbouring parameter values whose motions have the same label."""

    label: str
    """The label as text."""
    low: float
    """Smallest value of the parameter."""
    high: float
    """Largest value of the parameter."""
    direction: int
    """1 for values on an upward sweep, -1 on a downward sweep, 0 for independent
    starts.
    """


class Diagram:
    """The result of [`jaxcam.sweeps.diagram`][].

    `dataset` has the dimensions point (parameter values, in the order in which they
    were visited), start, sample and component, and the variables `state`, `hits`
    (impacts since the previous sample), `impacts` and `turns` (the label, see
    [`jaxcam.sweeps.attractors.Labels`][]), `code` (0, or the reason for a failure) and,
    if samples are not one period apart, `time` (s) and `phase` (in periods, from 0 to
    1).

    Examples:
        >>> from jaxcam import sweeps
        >>> logistic = sweeps.Map(lambda x, p: p["mu"] * x * (1 - x), {"mu": 3.2})
        >>> found = sweeps.diagram(logistic, "mu", [2.8, 3.2], [0.3], keep=16)
        >>> found.parameter, found.values.tolist()
        ('mu', [2.8, 3.2])
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
        """Values of the parameter, shape `(points,)`."""
        return self.dataset[self.parameter].values

    @property
    def states(self) -> np.ndarray:
        """Samples of the steady-state motions, shape `(points, starts, keep, n)`."""
        return self.dataset["state"].values

    @property
    def direction(self) -> np.ndarray:
        """1 for values on an upward sweep, -1 on a downward sweep, 0 for independent
        starts; shape `(points,)`.
        """
        return self.dataset["direction"].values

    @property
    def labels(self) -> np.ndarray:
        """Labels as text, such as P(1,1) or P(inf,1), shape `(points, starts)`.

        A motion without a period whose points still approach each other at the end is
        "not settled".
        """
        numbers = Labels(self.dataset["impacts"].values, self.dataset["turns"].values)
        names, open_ = label_names(numbers), numbers.turns == APERIODIC
        if np.any(open_):
            names = names.astype(object)
            slow = drifting(self.states[open_])
            names[open_] = np.where(slow, "not settled", names[open_])
        return names

    def ranges(self, start: int = 0) -> list[Range]:
        """Return the labels in order, each with its range of parameter values.

        Args:
            start: Index of the initial state, if there are several.

        Returns:
            A list of `Range`.

        Examples:
            >>> from jaxcam import sweeps
            >>> logistic = sweeps.Map(lambda x, p: p["mu"] * x * (1 - x), {"mu": 3.2})
            >>> found = sweeps.diagram(logistic, "mu", [2.7, 2.8, 3.2], [0.3], keep=16)
            >>> [(one.label, one.low, one.high) for one in found.ranges()]
            [('period 1', 2.7, 2.8), ('period 2', 3.2, 3.2)]
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
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> ShortTable:
        """Return a table of the labels of the motions from the first start."""
        points, starts, keep, _ = self.states.shape
        sentence = (
            f"Diagram of {self.parameter}: {points} values, {starts} "
            f"{'start' if starts == 1 else 'starts'}, {keep} samples of each motion."
        )
        headings = ("motion", f"lowest {self.parameter}", f"highest {self.parameter}")
        ways = {1: "upwards", -1: "downwards", 0: ""}
        swept = bool(np.any(self.direction != 0))
        rows = [
            (one.label, f"{one.low:.6g}", f"{one.high:.6g}", ways[one.direction])
            for one in self.ranges()
        ]
        if not swept:
            return ShortTable(sentence, headings, [r[:3] for r in rows], ("motion",))
        return ShortTable(sentence, (*headings, "sweep"), rows, ("motion", "sweep"))
