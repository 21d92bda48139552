"""All columns of a file, by name."""

import dataclasses
import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from .._errors import RecordingError


# Largest plausible value in any unit (including microseconds since 1970), small enough
# for its fourth power to be finite
_LARGEST_NUMBER = 1e18
# maximum number of names in a sentence
_LISTED = 12


@dataclasses.dataclass(frozen=True)
class Source:
    """Columns of a file, as text or as numbers.

    - `columns`: the columns by name; those of a text file contain text.
    - `headings`: the name of the column for each heading in the file.
    - `rate`: samples per second, if the file gives them outside the table.
    - `notes`: remarks on omitted data.
    """

    file: Path
    columns: Mapping[str, Any]
    headings: Mapping[str, str] = dataclasses.field(default_factory=dict)
    rate: float | None = None
    notes: tuple[str, ...] = ()

    def name_of(self, word: str) -> str:
        """Return the name of the column with this name or heading. **Raises:**
        `RecordingError` if missing.
        """
        if word in self.columns:
            return word
        if word in self.headings:
            return self.headings[word]
        small = {name.lower(): name for name in (*self.columns, *self.headings)}
        near = [small[one] for one in difflib.get_close_matches(word.lower(), small, 1)]
        hint = f"is {shown(near[0])} meant?" if near else f"it has {self.listed()}."
        raise RecordingError(f"{self.file}: there is no column {shown(word)}; {hint}")

    def listed(self) -> str:
        """Return the existing names for use in a sentence."""
        return listed(self.columns)

    def numbers(self, name: str, missing: bool = False) -> Float[np.ndarray, " k"]:
        """Return a column as numbers; with `missing`, an empty cell becomes NaN.

        **Raises:** `RecordingError`, which gives the row and says how to fix it.
        """
        column = self.columns[name]
        text = column.dtype.kind not in "fiub"
        numbers, empty = _of_text(self.file, name, column) if text else (column, None)
        numbers = np.asarray(numbers, dtype=float)
        if empty is None:
            empty = np.isnan(numbers)
        bad = np.flatnonzero(~(np.isfinite(numbers) | (empty & missing)))
        if len(bad):
            row = int(bad[0])
            word = str(column.iloc[row]).strip() if text else f"{numbers[row]}"
            found = shown(word) if word else "nothing"
            more = f" (and in {len(bad) - 1} more rows)" if len(bad) > 1 else ""
            raise RecordingError(
                f"{self.file}: the column {shown(name)} has {found} instead of a "
                f"number in row {row + 1} of the data{more}; remove those rows or the "
                "column."
            )
        absurd = np.flatnonzero(np.abs(numbers) > _LARGEST_NUMBER)
        if len(absurd):
            raise RecordingError(
                f"{self.file}: the column {shown(name)} has {numbers[absurd[0]]:.3g} "
                f"in row {absurd[0] + 1} of the data, which no sensor can measure; "
                "remove those rows or the column."
            )
        return np.where(empty, np.nan, numbers)


def listed(names: Iterable[str]) -> str:
    """Return names for use in a sentence; a long list is shortened."""
    every = list(names)
    there = ", ".join(map(shown, every[:_LISTED])) or "none"
    return f"{there} and {len(every) - _LISTED} more" if len(every) > _LISTED else there


def shown(text: str) -> str:
    """Quote text from a file, shortened and without control characters."""
    text = text if len(text) <= 40 else f"{text[:40]}..."
    printable = "".join(c if c.isprintable() else "?" for c in text)
    return f"`{printable.replace('`', '?')}`"


def _of_text(file: Path, name: str, column: pd.Series):
    """Convert a column of text to numbers, with NaN for other text, and flag empty
    cells.
    """
    column = column.str.strip().str.replace(r'^"(.*)"$', r"\1", regex=True)
    commas = column.str.contains(",", regex=False)
    if commas.any():
        both = np.flatnonzero(commas & column.str.contains(".", regex=False))
        if len(both):
            raise RecordingError(
                f"{file}: the column {shown(name)} has "
                f"{shown(str(column.iloc[both[0]]))} in row {both[0] + 1}, with both a "
                "point and a comma; save the numbers without thousands separators."
            )
        column = column.str.replace(",", ".", regex=False)
    numbers = pd.to_numeric(column, errors="coerce")
    empty = column.str.lower().isin(("", "nan"))
    return np.asarray(numbers, dtype=float), np.asarray(empty)
