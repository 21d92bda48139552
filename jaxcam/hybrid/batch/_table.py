"""A table that stores the log rows of each batch element at numbered places."""

from collections.abc import Callable

import numpy as np


class Table:
    """Rows by batch element and place; NaN where nothing has been written.

    **Arguments:** `row(record, state)`, which takes the record of an attempt and the
    state after it, and returns the place (negative for none) and the values of the row;
    the numbers of batch elements, places and columns; and the `first` place. A later
    row replaces an earlier one at the same place.
    """

    def __init__(
        self, row: Callable, lanes: int, places: int, width: int, first: int = 0
    ):
        self.row, self.first = row, first
        self.numbers = np.full((lanes, places, width), np.nan)

    def take(self, work, log) -> None:
        """Store the results of attempts, `(attempts, slots)` each, at their places.

        The first array of the log contains the places plus one; zero means none.
        """
        lanes, places, width = self.numbers.shape
        place, *values = [np.asarray(part).ravel() for part in log]
        at = np.flatnonzero(place > 0)
        lane, place = work[at % len(work)], place[at].astype(int) - 1 - self.first
        # rounding may separate the end of the run from its last stop
        real = (place >= 0) & (place < places)
        at = at[real]
        # one index into all batch elements and places is faster than two
        rows = self.numbers.reshape(lanes * places, width)
        found = np.stack([value[at] for value in values], axis=1)
        rows[lane[real] * places + place[real]] = found
