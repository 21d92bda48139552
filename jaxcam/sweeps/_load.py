"""Sweeps read back from disk."""

import json
from pathlib import Path

from ._basins_result import Basins
from ._chart_result import Chart
from ._diagram_result import Diagram
from ._grid import Grid
from .blocks import checked, SWEEP


def load_sweep(path: str | Path) -> Diagram | Basins | Chart:
    """A stored sweep, after a look at the checksums of all of its blocks.

    Without jaxcam, `xarray.open_dataset(path, engine="zarr", consolidated=False)` reads
    the same, unchecked.

    Raises:
        ValueError: That names the blocks that are missing or damaged, or where there is
            no sweep, or one that is not finished.
    """
    dataset = checked(path)
    identity = json.loads(dataset.attrs[SWEEP])
    kind = identity["sweep"]
    if kind == "diagram":
        return Diagram(dataset)
    if kind == "chart":
        return Chart(dataset)
    grid = identity["grid"]
    return Basins(dataset, Grid(grid["low"], grid["high"], grid["shape"]))
