"""Read tables from Excel workbooks."""

import io
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .._errors import RecordingError
from ._bytes import LARGEST, MOST, read_bytes, too_large
from ._source import listed, Source
from ._table import table_of_lines
from ._text import kept_lines


def read_excel(file: Path, names: Sequence[str] | None = None) -> Source:
    """Read the only table of numbers in a workbook; needs `openpyxl`.

    **Arguments:** as for `read_table`.

    **Raises:** `RecordingError` if `openpyxl` is missing, or the file is not a
    workbook.
    """
    raw = read_bytes(file)
    try:
        # pandas needs openpyxl for workbooks and reports its absence only on reading
        import openpyxl  # noqa: F401 (only its absence matters)  # pyright: ignore
        import pandas as pd
    except ImportError:
        raise RecordingError(
            f"{file}: to read Excel, install the package openpyxl (pip install "
            f"'jaxcam[excel]'), or save the table as CSV."
        ) from None
    _refuse_bomb(file, raw)
    try:
        sheets = pd.read_excel(
            io.BytesIO(raw), sheet_name=None, header=None, dtype=object
        )
    except Exception:
        # the parser may raise any exception for a broken file
        raise _none(file) from None
    full = {}
    for name, sheet in sheets.items():
        if sheet.size > MOST:
            raise too_large(file)
        rows = (map(_cell, row) for row in sheet.itertuples(index=False))
        lines = list(map("\t".join, rows))
        if sum(bool(line.strip()) for line in lines) > 1:
            full[str(name)] = lines
    if len(full) != 1:
        which = f"tables on the sheets {listed(full)}" if full else "no table"
        raise RecordingError(
            f"{file}: the workbook has {which}; save one table per file, as .xlsx or "
            "CSV."
        )
    (lines,) = full.values()
    return table_of_lines(file, kept_lines(file, lines), names)


def _cell(value: Any) -> str:
    if value is None or value != value:
        return ""
    return " ".join(str(value).split())


def _refuse_bomb(file: Path, raw: bytes) -> None:
    """Raise `RecordingError` for a file that is not an archive, or is too large when
    decompressed.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(raw)) as archive:
            size = sum(part.file_size for part in archive.infolist())
    except (zipfile.BadZipFile, ValueError, OSError, NotImplementedError):
        raise _none(file) from None
    # XML takes about five bytes for each byte of a CSV file
    if size > 5 * LARGEST:
        raise too_large(file)


def _none(file: Path) -> RecordingError:
    return RecordingError(
        f"{file}: this is not an Excel workbook (.xlsx); save it again, or as CSV."
    )
