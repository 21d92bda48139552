"""Limit the time of a search."""

import time


class Clock:
    """The time that a search may take, from now on.

    When it is over, no further candidate is tried, and the best explanation found so
    far is assessed.

    **Arguments:** the time in minutes.
    """

    def __init__(self, minutes: float):
        self._begun, self._span = time.monotonic(), 60 * minutes
        # whether a candidate was left out because the time was over
        self.stopped = False

    @property
    def over(self) -> bool:
        """Whether the time is over; a caller who asks then leaves a candidate out."""
        return self.past(1.0)

    def past(self, share: float) -> bool:
        """Return whether a share of the time is over; a caller who asks then leaves a
        candidate out.
        """
        late = time.monotonic() > self._begun + share * self._span
        self.stopped |= late
        return late
