"""What a rig file says of the files of recordings: names of columns, and the rate."""

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ._toml import known_keys, Section


#: keys of a rig file that are about files
LAYOUT_KEYS = ("columns", "rate")


@dataclasses.dataclass(frozen=True)
class FileLayout:
    """How the columns of recordings are called; see `read_case` for both."""

    columns: Mapping[str, str | tuple[str, float]] | None = None
    rate: float | None = None


def read_layout(file: Path, tables: dict[str, Any]) -> FileLayout:
    """`[columns]` and `rate` of a rig file.

    An entry is the channel of a column, `Angle = "angle_deg"`, or also a factor:
    `Y1 = {channel = "height_m", factor = -8e-4}`.

    **Raises:** `RigError`, one sentence that names the file and the key.
    """
    rate = None
    if "rate" in tables:
        # a number beside the tables, in a section of its own making
        rate = Section(file, "rate", {"rate": {"rate": tables["rate"]}}).positive(
            "rate", "Hz"
        )
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
