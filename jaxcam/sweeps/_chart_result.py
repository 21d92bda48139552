"""A chart in the plane of two parameters."""

import numpy as np
import xarray

from ..tables import ShortTable
from ._exponents import Exponents
from .attractors import APERIODIC, label_names, Labels


class Chart:
    """The result of [`jaxcam.sweeps.chart`][].

    `dataset` has a dimension for each parameter, the second one first, and `start`; the
    variables are `impacts` and `turns` (the label), `code` (0, or the reason for a
    failure) and, if requested, `exponent` and `exponent_stderr` (1/s).

    Examples:
        >>> from jaxcam import sweeps
        >>> f = lambda x, p: p["a"] + p["b"] * x - x**2
        >>> quadratic = sweeps.Map(f, {"a": 0.0, "b": 0.5})
        >>> found = sweeps.chart(quadratic, ("a", "b"), [0.0, 0.1], [0.4, 0.5], [0.1])
        >>> found.parameters
        ('a', 'b')
    """

    def __init__(self, dataset: xarray.Dataset):
        self.dataset = dataset

    @property
    def parameters(self) -> tuple[str, str]:
        """Names of the two parameters."""
        roles = {c.attrs.get("role"): str(n) for n, c in self.dataset.coords.items()}
        return roles["first"], roles["second"]

    @property
    def first(self) -> np.ndarray:
        """Values of the first parameter, shape `(k,)`."""
        return self.dataset[self.parameters[0]].values

    @property
    def second(self) -> np.ndarray:
        """Values of the second parameter, shape `(l,)`."""
        return self.dataset[self.parameters[1]].values

    @property
    def labels(self) -> np.ndarray:
        """Labels as text, shape `(l, k, starts)`; "chaotic" for an aperiodic motion
        whose exponent exceeds three standard errors.
        """
        numbers = Labels(self.dataset["impacts"].values, self.dataset["turns"].values)
        found = label_names(numbers)
        if "exponent" in self.dataset:
            exponents = Exponents(
                self.dataset["exponent"].values, self.dataset["exponent_stderr"].values
            )
            chaotic = (numbers.turns == APERIODIC) & exponents.chaotic
            found = np.where(chaotic, "chaotic", found)
        return found

    def __repr__(self) -> str:
        return self._table().text()

    def _repr_html_(self) -> str:
        return self._table().html()

    def _table(self) -> ShortTable:
        """Return a table of the labels, the most frequent one first."""
        one, other = self.parameters
        names, counts = np.unique(self.labels, return_counts=True)
        order = np.argsort(-counts, kind="stable")
        sentence = (
            f"Chart of {one} ({len(self.first)} values) and {other} "
            f"({len(self.second)} values)."
        )
        rows = [(str(names[k]), f"{counts[k] / self.labels.size:.1%}") for k in order]
        return ShortTable(sentence, ("motion", "fraction"), rows, ("motion",))
