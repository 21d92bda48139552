"""A chart over two parameters."""

import numpy as np
import xarray

from .attractors import APERIODIC, label_names, Labels


class Chart:
    """What [`jaxcam.sweeps.chart`][] returns.

    `dataset` has a dimension for each parameter, the second one first, and `start`; the
    variables are `impacts` and `turns` (the label), `code` (0, or why a motion failed),
    and, if asked for, `exponent` and `exponent_stderr` (1/s).
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
        """(k,) values of the first parameter."""
        return self.dataset[self.parameters[0]].values

    @property
    def second(self) -> np.ndarray:
        """(l,) values of the second parameter."""
        return self.dataset[self.parameters[1]].values

    @property
    def labels(self) -> np.ndarray:
        """(l, k, starts) labels in words; chaotic where an exponent says so."""
        numbers = Labels(self.dataset["impacts"].values, self.dataset["turns"].values)
        found = label_names(numbers)
        if "exponent" in self.dataset:
            largest = self.dataset["exponent"].values
            error = self.dataset["exponent_stderr"].values
            chaotic = (numbers.turns == APERIODIC) & (largest > 3 * error)
            found = np.where(chaotic, "chaotic", found)
        return found

    def __repr__(self) -> str:
        one, other = self.parameters
        return f"Chart({one}: {len(self.first)} values, {other}: {len(self.second)})"
