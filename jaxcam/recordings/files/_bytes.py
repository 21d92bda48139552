"""Read files into memory, with a size limit."""

import gzip
import io
import zlib
from pathlib import Path

from .._errors import RecordingError


LARGEST = 100_000_000
"""Maximum size of a decompressed table in bytes, enough for ten minutes at 5 kHz or an
hour at 800 Hz. Reading takes about ten times as much memory.
"""
MOST = 15_000_000
"""Maximum number of values in a table, regardless of the file's size."""
_GZIP = b"\x1f\x8b"


def read_bytes(file: Path) -> bytes:
    """Return the content of a file without decompressing it.

    Raises:
        RecordingError: The path is not a file, or the file is larger than `LARGEST`.
        OSError: The file cannot be read.
    """
    if file.is_dir():
        raise RecordingError(
            f"{file}: this is a folder; name a file in it, or read it as a case."
        )
    if not file.exists():
        raise RecordingError(f"{file}: there is no such file; check the path.")
    if not file.is_file():
        # a pipe is refused because it may be endless
        raise RecordingError(f"{file}: this is a pipe or a device; save it as a file.")
    with file.open("rb") as stream:
        raw = stream.read(LARGEST + 1)
    if len(raw) > LARGEST:
        raise too_large(file)
    return raw


def inflate_gzip(file: Path, raw: bytes) -> bytes:
    """Return the content of a .gz file.

    **Raises:** `RecordingError` if it is not compressed, is damaged, or is larger than
    `LARGEST` when decompressed.
    """
    if not raw.startswith(_GZIP):
        raise RecordingError(
            f"{file}: the name ends in .gz, but the file is not compressed; rename it "
            f"or compress it."
        )
    try:
        with gzip.GzipFile(fileobj=io.BytesIO(raw)) as stream:
            content = stream.read(LARGEST + 1)
    except EOFError:
        raise RecordingError(
            f"{file}: the compressed file is truncated; copy it again from its source."
        ) from None
    except (zlib.error, gzip.BadGzipFile):
        raise RecordingError(
            f"{file}: the compressed file is damaged; copy it again from its source."
        ) from None
    if len(content) > LARGEST:
        raise too_large(file)
    return content


def too_large(file: Path) -> RecordingError:
    return RecordingError(
        f"{file}: the table has more than {LARGEST // 10**6} MB or {MOST // 10**6} "
        f"million numbers, which is too much; divide it into files of a few minutes "
        f"each."
    )
