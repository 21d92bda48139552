"""A table in which each row of a log is stored at its batch element's place."""

from collections.abc import Callable

import numpy as np


class Table:
    """Rows by batch element and place; NaN where nothing has been written.

    **Arguments:** `row(record, state)`, which returns the place (negative for none) and
    the numbers of the row for an attempt and the state after it; the numbers of batch
    elements, places and columns; and the place that comes `first`. A later row replaces
    an earlier one in its place.
    """

    def __init__(
        self, row: Callable, lanes: int, places: int, width: int, first: int = 0
    ):
        self.row, self.first = row, first
        self.numbers = np.full((lanes, places, width), np.nan)

    def take(self, work, log) -> None:
        """Store the results of attempts, `(attempts, slots)` each, at their places.

        Places come first in the log, plus one; zero means none.
        """
        lanes, places, width = self.numbers.shape
        place, *values = [np.asarray(part).ravel() for part in log]
        at = np.flatnonzero(place > 0)
        lane, place = work[at % len(work)], place[at].astype(int) - 1 - self.first
        # rounding may set the end of the run apart from its last stop
        real = (place >= 0) & (place < places)
        at = at[real]
        # one index into all lanes and places is quicker than two
        rows = self.numbers.reshape(lanes * places, width)
        found = np.stack([value[at] for value in values], axis=1)
        rows[lane[real] * places + place[real]] = found
