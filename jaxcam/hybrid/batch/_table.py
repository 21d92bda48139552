"""A table in which each row of a log is stored at its batch element's place."""

from collections.abc import Callable

import numpy as np


class Table:
    """Rows by batch element and place; NaN where nothing has been written.

    **Arguments:** `row(record, state)`, which makes a place (negative for none) and the
    numbers of the row there of what an attempt did and the state after it; how many
    batch elements, places and numbers there are; and the place that comes `first`. A
    later row replaces an earlier one in its place.
    """

    def __init__(
        self, row: Callable, lanes: int, places: int, width: int, first: int = 0
    ):
        self.row, self.first = row, first
        self.numbers = np.full((lanes, places, width), np.nan)

    def take(self, work, log) -> None:
        """Put what some attempts made, `(attempts, slots)` each, where it belongs.

        Of the places, which come first, the log has one more: zero is none.
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
