"""Read tables from Qualisys Track Manager (.tsv): marker coordinates in mm."""

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd


def qtm_heading(
    preamble: Sequence[str], width: int
) -> tuple[list[str], float | None] | None:
    """Return column names and sampling rate, or `None` for a file of another program.

    **Arguments:** the lines above the numbers, and the number of columns.
    """
    fields = {}
    for line in preamble:
        key, *values = (cell.strip() for cell in line.split("\t"))
        fields[key] = [value for value in values if value]
    if not {"MARKER_NAMES", "FREQUENCY"} <= set(fields):
        return None
    markers = [re.sub(r"\W+", "_", name) for name in fields["MARKER_NAMES"]]
    axes = [f"{name}_{axis}_mm" for name in markers for axis in "xyz"]
    if width == len(axes) + 2:
        # the file was written with the option to include frame and time
        return ["frame", "time_s", *axes], None
    rate = fields["FREQUENCY"]
    return axes, float(rate[0].replace(",", ".")) if rate else None


def without_lost(columns: dict[str, pd.Series]) -> dict[str, pd.Series]:
    """Return the columns with empty cells for lost markers (written as 0 0 0)."""
    found = dict(columns)
    for name in columns:
        if not name.endswith("_x_mm"):
            continue
        three = [name.replace("_x_mm", f"_{axis}_mm") for axis in "xyz"]
        if not set(three) <= set(columns):
            continue
        lost = np.all([columns[one].str.fullmatch(r"\s*[0.,]+\s*") for one in three], 0)
        found |= {one: columns[one].mask(lost, "") for one in three}
    return found
