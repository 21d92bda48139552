"""Load sweeps from disk."""

import json
from pathlib import Path

from ._basins_result import Basins
from ._chart_result import Chart
from ._diagram_result import Diagram
from ._grid import Grid
from .blocks import checked, SWEEP


def load_sweep(path: str | Path) -> Diagram | Basins | Chart:
    """Load a stored sweep after verifying the checksums of all of its blocks.

    Without jaxcam, `xarray.open_dataset(path, engine="zarr", consolidated=False)` reads
    the same data without verifying the checksums.

    Args:
        path: Folder of the sweep.

    Returns:
        The result of the sweep.

    Raises:
        ValueError: Blocks are missing or damaged (the message names them), or the
            folder contains no sweep or an unfinished one.

    Examples:
        >>> from jaxcam import sweeps
        >>> cubic = sweeps.Map(lambda x, p: 1.5 * x - 0.5 * x**3)
        >>> _ = sweeps.basins(cubic, sweeps.Grid([-1.0], [1.0], [10]), out="cubic.zarr")
        >>> sweeps.load_sweep("cubic.zarr").attractor.shape
        (10,)
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
