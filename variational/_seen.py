"""Values at the ends of the periods of many motions."""

import numpy as np


class Seen:
    """Sums of logarithms of growth and numbers of impacts at the ends of periods."""

    def __init__(self, lanes: int, stops: int, n: int):
        self.logs = np.full((lanes, stops, n), np.nan)
        self.hits = np.full((lanes, stops), np.nan)
        self.states = np.full((lanes, n), np.nan)
        self.logs[:, 0], self.hits[:, 0] = 0.0, 0.0
        self._filled = np.ones(lanes, dtype=int)

    @staticmethod
    def of(logs, hits, states) -> "Seen":
        """Return an instance that contains the values of all periods."""
        lanes, stops, n = logs.shape
        seen = Seen(lanes, stops + 1, n)
        seen.logs[:, 1:], seen.hits[:, 1:] = logs, hits
        # index of the last period that was reached
        reached = np.isfinite(hits).sum(axis=1) - 1
        seen.states[:] = states[np.arange(lanes), reached]
        return seen

    @property
    def share(self) -> float:
        """Return the fraction of periods completed, over all motions."""
        # the first entry is the start of the run
        done, most = self._filled - 1, self.logs.shape[1] - 1
        return float(np.mean(np.minimum(done, most))) / most

    @property
    def complete(self) -> bool:
        """Return whether every period is filled."""
        return bool(np.all(self._filled >= self.logs.shape[1]))

    def take_turns(self, logs, hits, after) -> None:
        """Add values at the ends of the next periods, `(motions, turns, ...)`."""
        first = int(self._filled[0])
        count = min(logs.shape[1], self.logs.shape[1] - first)
        self.logs[:, first : first + count] = logs[:, :count]
        self.hits[:, first : first + count] = hits[:, :count]
        self.states[:] = after[:, count - 1]
        self._filled += count
