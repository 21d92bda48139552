"""Read the lines of a text file written by any program."""

import csv
import re
from pathlib import Path
from typing import NamedTuple

from .._errors import RecordingError
from ._bytes import inflate_gzip, MOST, read_bytes, too_large
from ._form import is_number


_UTF16 = b"\xff\xfe", b"\xfe\xff"
# signature of pre-2007 workbooks, which are often named like a text file
_OLD_EXCEL = b"\xd0\xcf\x11\xe0"


class Lines(NamedTuple):
    """The lines of a file that are not blank. `whole` tells whether the last one ends
    with a newline, so that it is known to be complete; `notes` are remarks on omitted
    data.
    """

    text: list[str]
    whole: bool = True
    notes: tuple[str, ...] = ()


def read_lines(file: Path) -> Lines:
    """Return the lines of a text file (plain or gzipped) to the end of its first table.

    **Raises:** `RecordingError` for a file that is missing, empty, truncated or not
    text.
    """
    raw = read_bytes(file)
    if file.suffix.lower() == ".gz" and raw:
        raw = inflate_gzip(file, raw)
    text = _decoded(file, raw).replace("\r\n", "\n").replace("\r", "\n")
    if sum(text.count(mark) for mark in "\n,;\t ") > 2 * MOST:
        raise too_large(file)
    return kept_lines(file, text.split("\n"), text.endswith("\n"))


def kept_lines(file: Path, every: list[str], whole: bool = True) -> Lines:
    """Return the lines that are not blank; a second table after a blank line is
    omitted.

    **Raises:** `RecordingError` if there is none.
    """
    lines, notes, gap = [], (), False
    for number, line in enumerate(every):
        if not line.strip():
            gap = True
            continue
        if gap and lines and _is_row(lines[-1]) and not any(_numbers(line)):
            what = " ".join(line.split())[:40]
            notes = (
                f"{file.name}: another table ({what}) begins in line {number + 1}; it "
                "is omitted.",
            )
            whole = True
            break
        lines.append(line)
        gap = False
    if not lines:
        raise RecordingError(f"{file}: the file is empty; repeat the recording.")
    return Lines(_unquoted(lines), whole, notes)


def _numbers(line: str) -> list[bool]:
    """Return whether each word of a line is a number."""
    return [is_number(word) for word in re.split(r"[\t; ]+", line) if word]


def _is_row(line: str) -> bool:
    found = _numbers(line.replace(",", " "))
    return bool(found) and all(found)


def _decoded(file: Path, raw: bytes) -> str:
    if raw.startswith(_OLD_EXCEL):
        raise RecordingError(
            f"{file}: this is a pre-2007 Excel workbook; save it as .xlsx or CSV."
        )
    try:
        if raw.startswith(_UTF16):
            # UTF-16, called Unicode by Excel and LabVIEW
            return raw.decode("utf-16")
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        pass
    try:
        # a file from a Western Windows system may contain a degree or micro sign in
        # this encoding
        text = raw.decode("cp1252") if not raw.startswith(_UTF16) else "\0"
    except UnicodeDecodeError:
        text = "\0"
    if any(ord(letter) < 32 and letter not in "\n\r\t\f" for letter in set(text)):
        raise RecordingError(
            f"{file}: this is not a text file; give a table of numbers as text (CSV), "
            f".mat, .xlsx or .parquet."
        )
    return text


def _unquoted(lines: list[str]) -> list[str]:
    """Convert lines of quoted cells to lines separated by tabs."""
    if '"' not in lines[-1] or any(line.count('"') % 2 for line in lines):
        return lines
    # the separator is next to the quotes in the last line, which contains numbers
    mark = next((m for m in "\t;," if f'"{m}' in lines[-1] or f'{m}"' in lines[-1]), "")
    if not mark:
        return lines
    rows = csv.reader(lines, delimiter=mark)
    return ["\t".join(cell.replace("\t", " ") for cell in row) for row in rows]
