"""From a file to named columns of numbers, with one sentence for what is wrong."""

import gzip
import io
import zlib
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from ._errors import RecordingError


SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz")


def read_table(file: Path) -> dict[str, Float[np.ndarray, " k"]]:
    """The columns of a text table, plain or gz, in the order of the file.

    **Raises:** `RecordingError` for a file that is missing, empty, cut short, not a
    text table, or has something other than finite numbers in it.
    """
    text = _text(file)
    lines = text.splitlines()
    if not any(line.strip() for line in lines):
        raise RecordingError(f"{file}: the file is empty; record the run again.")
    separator = next((mark for mark in ",;\t" if mark in lines[0]), ",")
    names = [name.strip() for name in lines[0].split(separator)]
    if all(_is_number(name) for name in names):
        raise RecordingError(
            f"{file}: the first line is numbers; it must name the columns, for example "
            f"`time_s,cam_angle_rad,follower_angle_rad`."
        )
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise RecordingError(
            f"{file}: the column `{min(repeated)}` appears twice; remove one of them."
        )
    rows = [line for line in lines[1:] if line.strip()]
    if len(rows) < 2:
        raise RecordingError(
            f"{file}: it has {len(rows)} rows of samples below its header, and at "
            f"least two are needed."
        )
    _refuse_cut_line(file, text, rows, separator, len(names))
    table = pd.read_csv(
        io.StringIO("\n".join(rows)),
        sep=separator,
        names=names,
        dtype=str,
        keep_default_na=False,
    )
    return {name: _numbers(file, name, table[name]) for name in names}


def _text(file: Path) -> str:
    if not file.exists():
        raise RecordingError(f"{file}: there is no such file; check the path.")
    if file.is_dir():
        raise RecordingError(
            f"{file}: this is a folder; name a file in it, or read it as a case."
        )
    raw = file.read_bytes()
    if file.suffix == ".gz" and raw:
        try:
            raw = gzip.decompress(raw)
        except (EOFError, zlib.error):
            raise RecordingError(
                f"{file}: the compressed file is cut short; copy it again from where "
                f"it came from."
            ) from None
        except gzip.BadGzipFile:
            raise RecordingError(
                f"{file}: the name ends in .gz but the file is not compressed; rename "
                f"it or compress it."
            ) from None
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise RecordingError(
            f"{file}: this is not a text file; give a table of comma-separated numbers."
        ) from None


def _refuse_cut_line(file, text, rows, separator, width) -> None:
    """A writer that was stopped leaves a last line with values or digits missing."""
    counts = np.array([row.count(separator) + 1 for row in rows])
    wrong = np.flatnonzero(counts != width)
    cut = len(wrong) > 0
    if not cut and not text.endswith(("\n", "\r")):
        # All values are there. A number that is shorter than every other one in its
        # column has lost digits: only a file with a fixed format can tell.
        last = [len(row.rpartition(separator)[2].partition(".")[2]) for row in rows]
        cut = len(set(last[:-1])) == 1 and last[-1] < last[0]
    if cut and (len(wrong) == 0 or wrong[0] == len(rows) - 1):
        raise RecordingError(
            f"{file}: the last line (`{rows[-1]}`) is cut short, so the file is not "
            f"whole; copy it again or delete that line."
        )
    if cut:
        row = int(wrong[0])
        raise RecordingError(
            f"{file}: row {row + 1} has {counts[row]} values where the header names "
            f"{width} columns; repair or delete that row."
        )


def _numbers(file: Path, name: str, column) -> Float[np.ndarray, " k"]:
    numbers = np.asarray(pd.to_numeric(column, errors="coerce"), dtype=float)
    bad = np.flatnonzero(~np.isfinite(numbers))
    if len(bad):
        row = int(bad[0])
        found = column.iloc[row].strip() or "nothing"
        more = f" (and in {len(bad) - 1} more rows)" if len(bad) > 1 else ""
        raise RecordingError(
            f"{file}: the column `{name}` has {found} where a number should be, in row "
            f"{row + 1}{more}; remove those rows or the column."
        )
    return numbers


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
