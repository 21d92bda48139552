"""The lines of a text file, whichever program wrote it."""

import csv
from pathlib import Path

from .._errors import RecordingError
from ._bytes import inflate_gzip, MOST, read_bytes, too_large


_UTF16 = b"\xff\xfe", b"\xfe\xff"
# of workbooks of before 2007, which are often named like text
_OLD_EXCEL = b"\xd0\xcf\x11\xe0"


def read_lines(file: Path) -> tuple[list[str], bool]:
    """The lines of a text file, plain or gz, that are not blank.

    **Returns:** the lines, and whether the last one ends in a newline.

    **Raises:** `RecordingError` for a file that is missing, empty, cut short or no
    text.
    """
    raw = read_bytes(file)
    if file.suffix.lower() == ".gz" and raw:
        raw = inflate_gzip(file, raw)
    text = _decoded(file, raw).replace("\r\n", "\n").replace("\r", "\n")
    if sum(text.count(mark) for mark in "\n,;\t ") > 2 * MOST:
        raise too_large(file)
    lines = [line for line in text.split("\n") if line.strip()]
    if not lines:
        raise RecordingError(f"{file}: the file is empty; record the run again.")
    return _unquoted(lines), text.endswith("\n")


def _decoded(file: Path, raw: bytes) -> str:
    if raw.startswith(_OLD_EXCEL):
        raise RecordingError(
            f"{file}: this is a workbook of an Excel before 2007; save it as .xlsx or "
            f"as CSV."
        )
    try:
        if raw.startswith(_UTF16):
            # the text that Excel and LabVIEW call Unicode
            return raw.decode("utf-16")
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        pass
    try:
        # a degree sign or a micro of a western Windows
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
    """Lines whose cells stand in quotes, with tabs between the cells instead."""
    if '"' not in lines[-1] or any(line.count('"') % 2 for line in lines):
        return lines
    # between the quotes of the last line, which is one of numbers
    mark = next((m for m in "\t;," if f'"{m}' in lines[-1] or f'{m}"' in lines[-1]), "")
    if not mark:
        return lines
    rows = csv.reader(lines, delimiter=mark)
    return ["\t".join(cell.replace("\t", " ") for cell in row) for row in rows]
