"""Define targets: printed values, computation and drawing."""

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any, TYPE_CHECKING, TypeAlias

import numpy as np
from matplotlib.figure import Figure

from ..models import CamFollower
from .progress import Report, reporting


if TYPE_CHECKING:
    import pandas as pd


Row: TypeAlias = tuple[str, Any, Any, str]
"""Quantity, printed value, computed value, unit."""
Rows: TypeAlias = list[Row]
SIZES = ("default", "full")


@dataclasses.dataclass(frozen=True)
class Target:
    """A table or figure of the thesis: its numbers and its drawing."""

    title: str
    """Title of the table or figure."""
    compute: Callable[..., Rows]
    """Takes the rig; returns rows of quantity, printed value, computed value and
    unit.
    """
    draw: Callable[..., Figure] | None = None
    """Takes the rig and returns the figure; None for a table."""
    sized: bool = False
    """Whether `compute` and `draw` also take a size, "default" or "full"."""
    note: str = ""
    """Remark on the comparison."""

    def table(
        self,
        system: CamFollower,
        size: str = SIZES[0],
        *,
        progress: Report | None = None,
    ) -> "pd.DataFrame":
        """Return printed and computed values, as [`jaxcam.thesis.reproduce`][] does."""
        with reporting(progress):
            return frame(self.compute(system, *self._size(size)))

    def figure(
        self,
        system: CamFollower,
        size: str = SIZES[0],
        *,
        progress: Report | None = None,
    ) -> Figure | None:
        """Return the drawing in the current style; None for a table.

        `progress` is called with a sentence and the completed fraction (or `None`).
        """
        if self.draw is None:
            return None
        with reporting(progress):
            return self.draw(system, *self._size(size))

    def _size(self, size: str) -> tuple[str, ...]:
        if size not in SIZES:
            known = " or ".join(SIZES)
            raise ValueError(f"There is no size {size!r}; choose {known}.")
        return (size,) if self.sized else ()


def frame(rows: Iterable[Row]) -> "pd.DataFrame":
    """Create a table from rows of quantity, printed value, computed value and unit.

    The relative difference is the difference divided by the magnitude of the printed
    value; NaN if the printed value is zero and the computed value is not.
    """
    import pandas as pd

    table = pd.DataFrame(
        [
            (name, float(printed), float(found), unit)
            for name, printed, found, unit in rows
        ],
        columns=["quantity", "printed", "computed", "unit"],
    )
    difference = table["computed"] - table["printed"]
    size = table["printed"].abs().where(table["printed"] != 0, np.nan)
    table["difference"] = difference
    table["relative"] = (difference / size).where(difference != 0, 0.0)
    return table
