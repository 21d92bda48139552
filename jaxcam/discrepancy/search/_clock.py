"""Limit the time of a search."""

import time


class Clock:
    """The time that a search may take, from now on.

    When it is over, no further candidate is tried, and the best explanation found so
    far is assessed. Time in which other programs occupy the processor does not count,
    so that the verdict does not depend on how busy the machine is.

    **Arguments:** the time in minutes.
    """

    def __init__(self, minutes: float):
        self._allowed = 60 * minutes
        self._begun = time.monotonic(), time.process_time()
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
        now = time.monotonic(), time.process_time()
        # several threads use more processor time than passes on the clock
        spent = min(b - a for a, b in zip(self._begun, now, strict=True))
        late = spent > share * self._allowed
        self.stopped |= late
        return late
