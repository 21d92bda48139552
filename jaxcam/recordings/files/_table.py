"""From a file to named columns of numbers, with one sentence for what is wrong."""

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from .._errors import RecordingError
from ._bytes import inflate_gzip, MOST, read_bytes, too_large


SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz")
# What no sensor measures in any unit, microseconds since 1970 included; the square of a
# square of it is still a number.
LARGEST_NUMBER = 1e18


def read_table(file: Path) -> dict[str, Float[np.ndarray, " k"]]:
    """The columns of a text table, plain or gz, in the order of the file.

    **Raises:** `RecordingError` for a file that is missing, empty, cut short, not a
    text table, or has something other than finite numbers in it.
    """
    text = _text(file)
    if sum(text.count(mark) for mark in "\n,;\t") > MOST:
        raise too_large(file)
    lines = [line for line in text.split("\n") if line.strip()]
    if not lines:
        raise RecordingError(f"{file}: the file is empty; record the run again.")
    separator = next((mark for mark in ",;\t" if mark in lines[0]), ",")
    names = [name.strip().strip('"').strip() for name in lines[0].split(separator)]
    if all(_is_number(name) for name in names):
        raise RecordingError(
            f"{file}: the first line is numbers; it must name the columns, for example "
            f"`time_s,cam_angle_rad,follower_angle_rad`."
        )
    if "" in names:
        raise RecordingError(
            f"{file}: column {names.index('') + 1} has no name; name it in the first "
            f"line, or remove it."
        )
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise RecordingError(
            f"{file}: the column {shown(min(repeated))} appears twice; remove one of "
            f"them."
        )
    rows = lines[1:]
    if len(rows) < 2:
        raise RecordingError(
            f"{file}: it has {len(rows)} rows of samples below its header, and at "
            f"least two are needed."
        )
    whole = text.endswith("\n")
    del text, lines
    _refuse_cut_line(file, whole, rows, separator, len(names))
    table = pd.read_csv(
        io.StringIO("\n".join(rows)),
        sep=separator,
        names=names,
        dtype=str,
        keep_default_na=False,
        quoting=csv.QUOTE_NONE,
        skip_blank_lines=False,
    )
    return {name: _numbers(file, name, table[name]) for name in names}


def shown(text: str) -> str:
    """A piece of a file between backquotes, short and without control characters."""
    text = text if len(text) <= 40 else f"{text[:40]}..."
    printable = "".join(c if c.isprintable() else "?" for c in text)
    return f"`{printable.replace('`', '?')}`"


def _text(file: Path) -> str:
    """The text of a file; its lines end in one newline each."""
    raw = read_bytes(file)
    if file.suffix.lower() == ".gz" and raw:
        raw = inflate_gzip(file, raw)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise RecordingError(
            f"{file}: this is not a text file; give a table of comma-separated numbers."
        ) from None
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _refuse_cut_line(file, whole, rows, separator, width) -> None:
    """A writer that was stopped leaves a last line with values or digits missing."""
    counts = np.array([row.count(separator) + 1 for row in rows])
    wrong = np.flatnonzero(counts != width)
    cut = len(wrong) > 0
    if not cut and not whole:
        # All values are there. A number that is shorter than every other one in its
        # column has lost digits: only a file with a fixed format can tell.
        last = [len(row.rpartition(separator)[2].partition(".")[2]) for row in rows]
        cut = len(set(last[:-1])) == 1 and last[-1] < last[0]
    if cut and (len(wrong) == 0 or wrong[0] == len(rows) - 1):
        raise RecordingError(
            f"{file}: the last line ({shown(rows[-1])}) is cut short, so the file is "
            f"not whole; copy it again or delete that line."
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
        word = column.iloc[row].strip()
        found = shown(word) if word else "nothing"
        more = f" (and in {len(bad) - 1} more rows)" if len(bad) > 1 else ""
        raise RecordingError(
            f"{file}: the column {shown(name)} has {found} where a number should be, "
            f"in row {row + 1}{more}; remove those rows or the column."
        )
    refuse_absurd(file, name, numbers)
    return numbers


def refuse_absurd(file: Path, name: str, numbers: Float[np.ndarray, " k"]) -> None:
    """**Raises:** `RecordingError` for a number that no sensor measures."""
    bad = np.flatnonzero(np.abs(numbers) > LARGEST_NUMBER)
    if len(bad):
        raise RecordingError(
            f"{file}: the column {shown(name)} has {numbers[bad[0]]:.3g} in row "
            f"{bad[0] + 1}, which no sensor measures; remove those rows or the column."
        )


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
