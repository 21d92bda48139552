"""Read columns of numbers from Parquet files."""

import io
from pathlib import Path

from .._errors import RecordingError
from ._bytes import MOST, read_bytes, too_large
from ._heading import channel_name
from ._source import shown, Source


def read_parquet(file: Path) -> Source:
    """Return the columns of a Parquet file; needs the package `pyarrow`.

    **Raises:** `RecordingError` if `pyarrow` is missing, or the file is not a Parquet
    file.
    """
    raw = read_bytes(file)
    try:
        from pyarrow import parquet  # pyright: ignore
    except ImportError:
        raise RecordingError(
            f"{file}: to read Parquet, install the package pyarrow (pip install "
            f"'jaxcam[parquet]'), or save the table as CSV."
        ) from None
    try:
        about = parquet.ParquetFile(io.BytesIO(raw)).metadata
        fits = about.num_rows * about.num_columns <= MOST
        table = parquet.read_table(io.BytesIO(raw)).to_pandas() if fits else None
    except Exception:
        # the parser may raise any exception for a broken file
        raise RecordingError(
            f"{file}: this is not a Parquet file; save the table again, or as CSV."
        ) from None
    if table is None:
        raise too_large(file)
    if table.index.name is not None:
        # the index of a pandas table is an ordinary column
        table = table.reset_index()
    columns, headings = {}, {}
    for heading in table.columns:
        name = channel_name(str(heading))
        if name in columns:
            raise RecordingError(
                f"{file}: the column {shown(name)} appears twice; remove one of them."
            )
        headings[str(heading)] = name
        columns[name] = _numbers_or_text(table[heading])
    return Source(file, columns, headings)


def _numbers_or_text(column):
    try:
        return column.to_numpy(dtype=float)
    except (ValueError, TypeError):
        return column.astype(str)
