"""Print short tables of results, and choose suitable units."""

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

import numpy as np


# number of rows shown of a longer table: the first and the last ones
_MOST = 20
_CELL = 'style="text-align: {}"'
# units that accept a prefix; others (rpm, -) keep their numbers
_TAKES_PREFIX = ("rad", "m", "s", "N", "V")


class ShortTable(NamedTuple):
    """A sentence with a table below it; of a long table, only the first and last
    rows.
    """

    sentence: str
    headings: tuple[str, ...]
    rows: Sequence[tuple[str, ...]]
    # headings of text columns
    words: tuple[str, ...] = ()

    def text(self) -> str:
        """Return the table as text with aligned columns."""
        if not self.rows:
            return self.sentence
        lines = [self.headings, *self._shown()]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        made = [
            "  ".join(
                cell.ljust(width) if heading in self.words else cell.rjust(width)
                for cell, width, heading in zip(line, widths, self.headings)
            ).rstrip()
            for line in lines
        ]
        return "\n".join([self.sentence, *made])

    def html(self) -> str:
        """Return the table as HTML for a notebook."""
        sides = ["left" if one in self.words else "right" for one in self.headings]

        def row(cells, tag: str) -> str:
            made = (
                f"<{tag} {_CELL.format(side)}>{escape(cell)}</{tag}>"
                for cell, side in zip(cells, sides, strict=True)
            )
            return f"<tr>{''.join(made)}</tr>"

        sentence = f"<p>{escape(self.sentence)}</p>"
        if not self.rows:
            return sentence
        body = "".join(row(cells, "td") for cells in self._shown())
        head = row(self.headings, "th")
        return f"{sentence}<table><thead>{head}</thead><tbody>{body}</tbody></table>"

    def _shown(self) -> list[tuple[str, ...]]:
        if len(self.rows) <= _MOST:
            return list(self.rows)
        half, gap = _MOST // 2, tuple("…" for _ in self.headings)
        return [*self.rows[:half], gap, *self.rows[-half:]]


def scaled(unit: str, largest: float) -> tuple[float, str]:
    """Return a factor and a unit in which `largest` (in `unit`) is of order 1."""
    if unit.partition("/")[0] not in _TAKES_PREFIX or not 0 < largest < 0.05:
        return 1.0, unit
    if not np.isfinite(largest) or largest > 2e-5:
        return 1e3, f"m{unit}"
    return 1e6, f"µ{unit}"


def counted(number: int, noun: str) -> str:
    """Return a number and a noun, in the plural unless the number is one.

    Args:
        number: The number.
        noun: The noun in the singular, with a regular plural.

    Returns:
        The phrase.

    Examples:
        >>> from jaxcam.tables import counted
        >>> counted(1, "recording"), counted(2, "recording")
        ('1 recording', '2 recordings')
    """
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
