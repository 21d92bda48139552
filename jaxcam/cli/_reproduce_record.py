"""Store reproduced targets on disk: one file per target, complete or absent."""

import dataclasses
import json
import math
import os
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from ..models import CamFollower
from ..thesis import reproduce, TARGETS
from ._output import to_text
from ._source_mark import source_mark


# exceptions raised on reading a file that is not a record, such as one with too deeply
# nested brackets
_BROKEN = (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError)


@dataclasses.dataclass(frozen=True)
class Origin:
    """Everything that determines a result, except its target."""

    version: str
    preset: str
    size: str
    code: str
    """Mark of the code that computed the result; see `source_mark`."""

    @staticmethod
    def of(preset: str, size: str) -> "Origin":
        from importlib.metadata import version

        return Origin(version("jaxcam"), preset, size, source_mark())


@dataclasses.dataclass(frozen=True)
class TargetRecord:
    """One target: its numbers and computing time (s), or the reason for its failure."""

    name: str
    settings: Origin
    seconds: float
    rows: list[dict[str, Any]]
    error: str | None = None
    figure: bool = False

    @property
    def table(self):
        """Return the rows as a pandas table."""
        import pandas as pd

        numbers = ("printed", "computed", "difference", "relative")
        table = pd.DataFrame(self.rows, columns=["quantity", *numbers, "unit"])
        return table.astype(dict.fromkeys(numbers, float))


def make(
    name: str,
    system: CamFollower,
    settings: Origin,
    out: Path | None,
    keep_going: bool,
    progress: Callable[[str, float | None], None] | None = None,
) -> TargetRecord:
    """Compute a target, and draw it if a folder is given.

    **Arguments:** `keep_going`: whether to store an exception in the record instead of
    raising it; `progress`: as in `reproduce`, also called while the figure is drawn.
    """
    begin, rows, drawn = time.perf_counter(), [], False
    try:
        table = reproduce(name, system, settings.size, progress=progress)
        rows = table.to_dict(orient="records")
        if out is not None:
            table.to_csv(out / f"{name}.csv", index=False)
            drawn = _draw(name, system, settings.size, out, progress)
        error = None
    except Exception as problem:
        if not keep_going:
            raise
        error = f"{type(problem).__name__}: {problem}"
    seconds = time.perf_counter() - begin
    return TargetRecord(name, settings, seconds, rows, error, drawn)


def _draw(name: str, system, size: str, out: Path, progress) -> bool:
    """Draw the figure of a target, if it has one."""
    from ..plotting import save_figure, style

    with style():
        figure = TARGETS[name].figure(system, size, progress=progress)
        if figure is not None:
            save_figure(figure, out / f"{name}.png")
    return figure is not None


def write(record: TargetRecord, out: Path | None) -> None:
    """Store a record atomically: a killed run leaves either the old or the new
    record.
    """
    if out is None:
        return
    text = to_text(dataclasses.asdict(record))
    part = out / f"{record.name}.json.part"
    part.write_text(text + "\n", encoding="utf-8")
    os.replace(part, out / f"{record.name}.json")


def earlier(out: Path, name: str, settings: Origin) -> TargetRecord | None:
    """Return the record of an earlier run with the same settings, if complete."""
    try:
        record = _read(out, name)
        rows = [
            {key: math.nan if value is None else value for key, value in row.items()}
            for row in record.rows
        ]
        _ = record.table
    except _BROKEN:
        return None
    if record.settings != settings or record.error is not None:
        return None
    if record.figure and not (out / f"{name}.png").is_file():
        return None
    return dataclasses.replace(record, rows=rows)


def by_other_code(out: Path, names: Iterable[str], settings: Origin) -> list[str]:
    """Return the targets computed with the same settings, but by different code."""
    found = []
    for name in names:
        try:
            was = _read(out, name).settings
        except _BROKEN:
            continue
        alike = dataclasses.replace(was, code=settings.code, version=settings.version)
        if alike == settings and was != settings:
            found.append(name)
    return found


def _read(out: Path, name: str) -> TargetRecord:
    found = json.loads((out / f"{name}.json").read_text(encoding="utf-8"))
    # a record without a mark was computed by different code
    found["settings"] = Origin(**{"code": "", **found["settings"]})
    if found["name"] != name or not isinstance(found.get("figure", False), bool):
        raise ValueError("the record of another target, or damaged")
    return TargetRecord(**{**found, "seconds": float(found["seconds"])})
