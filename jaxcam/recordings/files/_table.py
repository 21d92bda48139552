"""Read named columns from a text file; each error message is one sentence."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from .._errors import RecordingError
from ._bytes import MOST, too_large
from ._form import bare, cells_of, COMMENTS, Form, form_of, is_number
from ._heading import channel_name
from ._qtm import qtm_heading, without_lost
from ._source import shown, Source
from ._text import Lines, read_lines


SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".lvm", ".lvm.gz")
LEFT_OUT = "-"
"""Name of a skipped column."""


def read_table(file: Path, names: Sequence[str] | None = None) -> Source:
    """Return the columns of a text table, plain or gzipped, in the order of the file.

    Cells are separated by tabs, semicolons, commas or spaces; numbers have a decimal
    point or comma. Names are in the line above the numbers, and units in the names or
    in the line below them; earlier lines and comments are skipped.

    **Arguments:** `names` of the columns in order, instead of those in the file; `"-"`
    skips one.

    **Raises:** `RecordingError` for a file that is missing, empty, truncated or not a
    text table, or whose column names are invalid.
    """
    return table_of_lines(file, read_lines(file), names)


def table_of_lines(
    file: Path, found: Lines, names: Sequence[str] | None = None
) -> Source:
    """Return the table in some lines. **Raises:** see `read_table`."""
    lines, whole, notes = found
    form = form_of(lines) or _as_it_seems(lines)
    separator = form.separator
    first = lines[min(form.first, len(lines) - 1)]
    rate = None
    recorded = qtm_heading(lines[: form.first], len(cells_of(first, separator)))
    if names is not None:
        titles = list(names)
    elif recorded is not None:
        titles, rate = recorded
    else:
        titles = _titles(file, lines, form)
    rows = [line for line in lines[form.first :] if not line.startswith(COMMENTS)]
    if len(rows) < 2:
        raise RecordingError(
            f"{file} has {len(rows)} rows of samples below its header; at least two "
            "are needed."
        )
    titles, rows = _without_last(titles, rows, separator)
    if len(rows) * len(titles) > MOST:
        raise too_large(file)
    _refuse_cut_line(file, whole, rows, separator, len(titles), names is not None)
    places = [str(k) for k in range(len(titles))]
    table = pd.read_csv(
        io.StringIO("\n".join(rows)),
        sep=r"\s+" if separator == " " else separator,
        names=places,
        dtype=str,
        index_col=False,
        keep_default_na=False,
        quoting=csv.QUOTE_NONE,
        skip_blank_lines=False,
    )
    kept = _kept(file, titles, [pd.Series(table[place]) for place in places])
    if recorded is not None and names is None:
        kept = without_lost(kept)
    headings = _headings(lines, form) if names is None else {}
    return Source(file, kept, headings, rate, notes)


def _without_last(titles: list[str], rows: list[str], separator: str):
    """Return names and rows; a separator at the end of only one of them is removed."""
    count = len(cells_of(rows[0], separator))
    if count == len(titles) - 1 and not titles[-1]:
        return titles[:-1], rows
    if count == len(titles) + 1 and separator != " ":
        bare_rows = [row.rstrip(" ") for row in rows]
        if all(row.endswith(separator) for row in bare_rows):
            return titles, [row[:-1] for row in bare_rows]
    return titles, rows


def _as_it_seems(lines: list[str]) -> Form:
    """Return the apparent form of an invalid table, for an error message."""
    separator = next((mark for mark in ",;\t" if mark in lines[0]), "")
    if not separator:
        separator = " " if " " in lines[0].strip() else ","
    return Form(separator, 0, None, 1)


def _titles(file: Path, lines: list[str], form: Form) -> list[str]:
    """Return the names of the columns, with units at the end."""
    if form.names is None:
        count = len(cells_of(lines[form.first], form.separator))
        where = "the first line has numbers" if form.first == 0 else "no line does so"
        raise RecordingError(
            f"{file}: a line above the numbers must name the columns, but {where}; "
            f"name all {count} columns in order, as in --columns "
            f"time_s,angle_rad (columns=[...] in Python), with {LEFT_OUT} for a "
            "skipped one."
        )
    titles = cells_of(bare(lines[form.names]), form.separator)
    if all(map(is_number, titles)):
        raise RecordingError(
            f"{file}: the first line has numbers; it must name the columns, for "
            f"example `time_s,cam_angle_rad,follower_angle_rad`."
        )
    units = [""] * len(titles)
    if form.units is not None:
        units = cells_of(lines[form.units], form.separator)
    return [channel_name(title, unit) for title, unit in zip(titles, units)]


def _headings(lines: list[str], form: Form) -> dict[str, str]:
    """Return the column name for each heading in the file."""
    if form.names is None:
        return {}
    words = cells_of(bare(lines[form.names]), form.separator)
    units = [""] * len(words)
    if form.units is not None:
        units = cells_of(lines[form.units], form.separator)
    return {word: channel_name(word, unit) for word, unit in zip(words, units)}


def _kept(file: Path, titles: list[str], columns: Sequence[pd.Series]):
    """Return columns by name, without empty columns and row numbers."""
    kept = {}
    for place, (title, column) in enumerate(zip(titles, columns)):
        if title == LEFT_OUT:
            continue
        if not title:
            numbered = column.str.strip() == pd.Series(range(1, len(column) + 1)).map(
                str
            )
            if numbered.all() or not _has_words(column):
                continue
            raise RecordingError(
                f"{file}: column {place + 1} has no name; name it in the first line, "
                f"or remove it."
            )
        if title in kept:
            raise RecordingError(
                f"{file}: the column {shown(title)} appears twice; remove one of "
                f"them, or name all columns in order with --columns "
                f"(columns=[...] in Python)."
            )
        kept[title] = column
    return {t: c for t, c in kept.items() if _has_words(c)} or kept


def _has_words(column: pd.Series) -> bool:
    return bool((column.str.strip() != "").any())


def _refuse_cut_line(file, whole, rows, separator, width, named) -> None:
    """Reject a last line that lacks values or digits because its writer was stopped."""
    if separator == " ":
        counts = np.array([len(row.split()) for row in rows])
    else:
        counts = np.array([row.count(separator) + 1 for row in rows])
    wrong = np.flatnonzero(counts != width)
    cut = len(wrong) > 0
    if not cut and not whole:
        # No value is missing. If the last number is shorter than all others in its
        # column, which have the same number of decimals, it has lost digits.
        last = [len(_decimals(cells_of(row, separator)[-1])) for row in rows]
        cut = len(set(last[:-1])) == 1 and last[-1] < last[0]
    if cut and (len(wrong) == 0 or wrong[0] == len(rows) - 1):
        raise RecordingError(
            f"{file}: the last line ({shown(rows[-1])}) is truncated, so the file is "
            "incomplete; copy it again or delete that line."
        )
    if cut:
        row = int(wrong[0])
        by = "--columns names" if named else "the header names"
        fix = "repair or delete that row"
        if separator == "," and counts[row] == 2 * width:
            fix = "if these are decimal commas, save it with semicolons between columns"
        elif separator == " ":
            fix = (
                "with spaces as separators, empty cells are lost: save it with tabs, "
                "or name the columns present in every row with --columns"
            )
        raise RecordingError(
            f"{file}: row {row + 1} has {counts[row]} values, but {by} {width} "
            f"columns; {fix}."
        )


def _decimals(number: str) -> str:
    return number.replace(",", ".").partition(".")[2]
