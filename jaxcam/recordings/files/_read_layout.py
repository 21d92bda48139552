"""Read the file layout in a rig file: column names and sampling rate."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .._errors import RigError
from ._toml import known_keys, Section, shown_value


LAYOUT_KEYS = ("columns", "rate")
"""Keys of a rig file that describe files."""


@dataclasses.dataclass(frozen=True)
class FileLayout:
    """Column names and sampling rate of recordings; see `read_case`."""

    columns: Mapping[str, str | tuple[str, float]] | None = None
    rate: float | None = None


def read_layout(file: Path, tables: dict[str, Any]) -> FileLayout:
    """Read `[columns]` and `rate` of a rig file.

    An entry gives the channel of a column, `Angle = "angle_deg"`, optionally with a
    factor: `Y1 = {channel = "height_m", factor = -8e-4}`.

    **Raises:** `RigError`, one sentence that names the file and the key.
    """
    rate = tables.get("rate")
    if rate is not None:
        number = isinstance(rate, int | float) and not isinstance(rate, bool)
        if not number or not 0 < rate < math.inf:
            raise RigError(
                f"{file}: `rate` is {shown_value(rate)}; give a positive number of "
                "samples per second."
            )
        rate = float(rate)
    if "columns" not in tables:
        return FileLayout(None, rate)
    section = Section(file, "columns", tables)
    found = {}
    for key, entry in section.table.items():
        if isinstance(entry, dict):
            known_keys(file, f"columns.{key}", entry, ("channel", "factor"))
            inner = Section(file, key, section.table, "columns")
            factor = inner.quantity("factor", None).value if "factor" in entry else 1.0
            if factor == 0:
                raise inner.error("factor", "is zero")
            found[key] = (inner.word("channel"), factor)
        else:
            found[key] = section.word(key)
    return FileLayout(found or None, rate)
