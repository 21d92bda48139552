"""Columns of numbers from MATLAB and Parquet files."""

import io
import struct
import warnings
import zlib
from pathlib import Path

import numpy as np
from jaxtyping import Float

from .._errors import RecordingError
from ._bytes import LARGEST, MOST, read_bytes, too_large
from ._table import refuse_absurd, shown


_HDF5 = b"\x89HDF"
# of a compressed element of a MATLAB file, and where the first element is
_COMPRESSED, _HEADER = 15, 128


def read_mat(file: Path) -> dict[str, Float[np.ndarray, " k"]]:
    """Vectors of a MATLAB file (up to version 7.2) by their names.

    Fields of a structure count as vectors too; anything else is ignored.

    **Raises:** `RecordingError` for a file that is none, or holds no vectors of equal
    length.
    """
    from scipy.io import loadmat

    raw = read_bytes(file)
    if raw[:128].startswith(b"MATLAB 7.3") or raw.startswith(_HDF5):
        raise RecordingError(
            f"{file}: this is a MATLAB file of version 7.3; save it again with "
            f"`save(..., '-v7')`."
        )
    _refuse_bomb(file, raw)
    try:
        with warnings.catch_warnings():
            # variables of the same name, and other oddities that loadmat only mentions
            warnings.simplefilter("error")
            found = loadmat(io.BytesIO(raw), squeeze_me=True, struct_as_record=False)
    except Exception:
        # a parser on a broken file raises whatever it stumbles over
        raise RecordingError(
            f"{file}: this is not a MATLAB file; save it again with `save(..., '-v7')`."
        ) from None
    columns: dict[str, np.ndarray] = {}
    for name, value in found.items():
        if name.startswith("__"):
            continue
        fields = getattr(value, "_fieldnames", None)
        if fields is None:
            columns[name] = value
        else:
            columns |= {field: getattr(value, field) for field in fields}
    vectors = {
        name: np.asarray(value, dtype=float)
        for name, value in columns.items()
        if isinstance(value, np.ndarray)
        and value.ndim == 1
        and np.issubdtype(value.dtype, np.number)
        and not np.issubdtype(value.dtype, np.complexfloating)
    }
    if "time_s" in vectors:
        length = len(vectors["time_s"])
    else:
        length = max((len(v) for v in vectors.values()), default=0)
    return _checked(file, {n: v for n, v in vectors.items() if len(v) == length})


def _refuse_bomb(file: Path, raw: bytes) -> None:
    """Raise `RecordingError` where compressed variables are too large together."""
    order = ">" if raw[126:128] == b"MI" else "<"
    place, room = _HEADER, LARGEST
    while place + 8 <= len(raw) and room >= 0:
        kind, size = struct.unpack_from(f"{order}II", raw, place)
        place += 8
        if kind == _COMPRESSED:
            inflating, piece = zlib.decompressobj(), raw[place : place + size]
            while piece and room >= 0:
                try:
                    room -= len(inflating.decompress(piece, 1 << 20))
                except zlib.error:
                    return
                piece = inflating.unconsumed_tail
        place += size
    if room < 0:
        raise too_large(file)


def read_parquet(file: Path) -> dict[str, Float[np.ndarray, " k"]]:
    """Columns of a Parquet file; needs the package `pyarrow`.

    **Raises:** `RecordingError` where that is missing, or for a file that is none.
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
        # a parser on a broken file raises whatever it stumbles over
        raise RecordingError(
            f"{file}: this is not a Parquet file; save the table again, or as CSV."
        ) from None
    if table is None:
        raise too_large(file)
    columns = {}
    for name in table.columns:
        try:
            columns[str(name)] = table[name].to_numpy(dtype=float)
        except (ValueError, TypeError):
            raise RecordingError(
                f"{file}: the column {shown(str(name))} is not numbers; remove it."
            ) from None
    return _checked(file, columns)


def _checked(file: Path, columns):
    if not columns or len(next(iter(columns.values()))) < 2:
        raise RecordingError(
            f"{file}: there are no columns of at least two numbers in it; save a "
            f"vector for the time (`time_s`) and one for each channel."
        )
    for name, values in columns.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad):
            raise RecordingError(
                f"{file}: the column {shown(name)} has {values[bad[0]]} where a number "
                f"should be, in row {bad[0] + 1}; remove those rows or the column."
            )
        refuse_absurd(file, name, values)
    return columns
