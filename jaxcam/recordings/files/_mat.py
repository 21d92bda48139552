"""Read vectors of numbers from MATLAB files, with dotted names inside structures."""

import io
import struct
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from .._errors import RecordingError
from ._bytes import LARGEST, read_bytes, too_large
from ._source import Source


_HDF5 = b"\x89HDF"
# type code of a compressed element of a MATLAB file, and position of the first element
_COMPRESSED, _HEADER = 15, 128
# maximum depth of nested structures that are searched, and maximum number of series in
# one array
_DEEPEST, _MOST_SERIES = 8, 300


def read_mat(file: Path) -> Source:
    """Return the vectors of a MATLAB file (up to version 7.2) by name.

    A vector in nested structures can be addressed by a dotted name, such as
    `run.left.angle_rad`, or by the last word of that name if this word is unique. The
    entries of an array of structures are numbered from 1. The series in an array with
    several axes extend along its longest axis and are numbered in the same way:
    `marker.3`. Other data are ignored.

    **Raises:** `RecordingError` if the file is not a MATLAB file, or contains no
    vectors of equal length.
    """
    found = _loaded(file)
    vectors: dict[str, np.ndarray] = {}
    for name, value in found.items():
        if not name.startswith("__"):
            vectors |= dict(_vectors(name, value, _DEEPEST))
    timed = [len(v) for name, v in vectors.items() if _is_time(name)]
    length = timed[0] if timed else max((len(v) for v in vectors.values()), default=0)
    kept = {name: v for name, v in vectors.items() if len(v) == length}
    if not kept or length < 2:
        raise RecordingError(
            f"{file}: it contains no columns of at least two numbers; save a vector "
            f"for the time (`time_s`) and one for each channel."
        )
    last = [name.rpartition(".")[2] for name in kept]
    short = {
        name: word
        for name, word in zip(kept, last)
        if last.count(word) == 1 and not word.isdigit() and word not in kept
    }
    columns = {short.get(name, name): vector for name, vector in kept.items()}
    return Source(file, columns, short)


def _is_time(name: str) -> bool:
    return name.rpartition(".")[2] == "time_s"


def _vectors(
    name: str, value: Any, depth: int
) -> Iterator[tuple[str, Float[np.ndarray, " k"]]]:
    """Yield each vector in a variable, with its dotted name."""
    fields = getattr(value, "_fieldnames", None)
    if fields is not None and depth:
        for field in fields:
            yield from _vectors(f"{name}.{field}", getattr(value, field), depth - 1)
        return
    if not isinstance(value, np.ndarray) or not value.size:
        return
    if value.dtype == object and depth:
        for number, part in enumerate(value.ravel()[:_MOST_SERIES], start=1):
            yield from _vectors(f"{name}.{number}", part, depth - 1)
        return
    if value.dtype.kind not in "fiu" or value.ndim == 0:
        return
    if value.ndim == 1:
        yield name, np.asarray(value, dtype=float)
        return
    along = np.moveaxis(value, int(np.argmax(value.shape)), -1)
    if along[..., 0].size > _MOST_SERIES:
        return
    for place in np.ndindex(along.shape[:-1]):
        inner = ".".join(str(k + 1) for k in place)
        yield f"{name}.{inner}", np.asarray(along[place], dtype=float)


def _loaded(file: Path) -> dict[str, Any]:
    """Return the variables of a file. **Raises:** `RecordingError` if it is invalid."""
    from scipy.io import loadmat

    raw = read_bytes(file)
    if raw[:128].startswith(b"MATLAB 7.3") or raw.startswith(_HDF5):
        raise RecordingError(
            f"{file}: this is a version 7.3 MATLAB file; save it again with "
            f"`save(..., '-v7')`."
        )
    _refuse_bomb(file, raw)
    try:
        with warnings.catch_warnings():
            # loadmat only warns about faults such as several variables with the same
            # name
            warnings.simplefilter("error")
            return loadmat(io.BytesIO(raw), squeeze_me=True, struct_as_record=False)
    except Exception:
        # the parser may raise any exception for a broken file
        raise RecordingError(
            f"{file}: this is not a MATLAB file; save it again with `save(..., '-v7')`."
        ) from None


def _refuse_bomb(file: Path, raw: bytes) -> None:
    """Raise `RecordingError` if the compressed variables are too large in total."""
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
