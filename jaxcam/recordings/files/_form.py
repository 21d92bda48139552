"""Find names, numbers and separators in a text table."""

import re
from collections.abc import Sequence
from typing import NamedTuple

from ._heading import is_time, is_unit


SEPARATORS = ("\t", ";", ",", " ")
"""Cell separators, the most specific first; a space stands for any white space."""
COMMENTS = ("#", "%", "//")
"""Beginnings of comment lines."""
# maximum number of lines of a preamble
_PREAMBLE = 300
# number of consistent rows required to recognise a table
_ROWS = 5
_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eEdD][+-]?\d+)?|[+-]?(nan|inf)")


class Form(NamedTuple):
    """The form of a table: the separator of its cells, and the lines of its parts.

    `names` and `units` are the indices of the lines of names and of units, or `None`;
    `first` is that of the first row.
    """

    separator: str
    names: int | None
    units: int | None
    first: int


def cells_of(line: str, separator: str) -> list[str]:
    """Return the cells of a line, without surrounding blanks and quotes."""
    parts = line.split() if separator == " " else line.split(separator)
    return [part.strip().strip('"').strip() for part in parts]


def form_of(lines: Sequence[str]) -> Form | None:
    """Return the form of a table, or `None` if no rows of numbers are found. Broken
    rows count as rows, so that their error is reported.
    """
    found = []
    for rank, separator in enumerate(SEPARATORS):
        first = _first_row(lines, separator)
        if first is not None:
            found.append((first, rank))
    if not found:
        return None
    first, rank = min(found)
    return _headed(lines, SEPARATORS[rank], first)


def is_number(text: str) -> bool:
    """Return whether a cell contains a number, with a decimal point or comma."""
    return _NUMBER.fullmatch(text.lower()) is not None


def _first_row(lines: Sequence[str], separator: str) -> int | None:
    kinds = [_kind(line, separator) for line in lines[: _PREAMBLE + _ROWS]]
    for k, (width, numbers) in enumerate(kinds):
        part = kinds[k : k + _ROWS]
        same = width > 1 and len(part) > 1 and all(w == width for w, _ in part)
        if same and all(n > 0 for _, n in part) and max(n for _, n in part) > 1:
            return k
    return None


def _kind(line: str, separator: str) -> tuple[int, int]:
    """Return the number of cells and of numbers in a row; the latter is zero if a cell
    contains other text.
    """
    if line.startswith(COMMENTS):
        return 0, 0
    cells = cells_of(line, separator)
    numbers = sum(map(is_number, cells))
    return len(cells), numbers if numbers + cells.count("") == len(cells) else 0


def _headed(lines: Sequence[str], separator: str, first: int) -> Form:
    """Return the form of a table whose complete rows begin at `first`."""
    width = len(cells_of(lines[first], separator))
    heads = [k for k in range(first) if _is_head(lines[k], separator, width)]
    if not heads:
        other = [k for k in range(first) if _is_other(lines[k], separator, width)]
        last = first - 1 if _is_any_head(lines, first - 1, separator) else None
        return Form(separator, other[-1] if other else last, None, first)
    names, units = heads[-1], None
    above = heads[-2] if len(heads) > 1 else None
    if above is not None:
        lower, upper = (cells_of(lines[k], separator) for k in (names, above))
        if all(map(is_unit, lower)):
            names, units = above, names
        elif any(map(is_time, upper)) and not any(map(is_time, lower)):
            # the lower line is not a header, but a first row with text instead of
            # numbers
            return Form(separator, above, None, names)
    for k in range((names if units is None else units) + 1, first):
        cells = cells_of(lines[k], separator)
        if lines[k].startswith(COMMENTS) or not any(map(is_number, cells)):
            continue
        # a line with text next to a number is a note if the separator is a space or is
        # missing
        note = len(cells) != width and (separator == " " or len(cells) == 1)
        if not note:
            return Form(separator, names, units, k)
    return Form(separator, names, units, first)


def _is_head(line: str, separator: str, width: int) -> bool:
    cells = cells_of(bare(line), separator)
    # a header has more than one cell with text; a note has text only in its first cell
    words = any(cells[1:]) or (len(cells) == 2 and bool(cells[0]))
    return len(cells) == width and words and not any(map(is_number, cells))


def _is_other(line: str, separator: str, width: int) -> bool:
    """Return whether a line contains the names of the columns although its number of
    cells differs from that of the rows. With spaces, rows lose their empty cells; with
    commas, decimal commas split their numbers.
    """
    count = len(cells_of(line, separator))
    lost = separator == " " and count > width
    cut = separator == "," and count * 2 == width
    return (lost or cut) and _is_head(line, separator, count)


def _is_any_head(lines: Sequence[str], place: int, separator: str) -> bool:
    """Return whether the line above the rows contains names, even if their number
    differs from that of the columns.
    """
    if place < 0 or separator == " ":
        return False
    count = len(cells_of(lines[place], separator))
    return count > 1 and _is_head(lines[place], separator, count)


def bare(line: str) -> str:
    """Return a line without its comment mark."""
    for mark in COMMENTS:
        if line.startswith(mark):
            return line.lstrip(mark).lstrip(" ")
    return line
