"""Samples of many lanes once a turn, and what happened in between."""

import jax.numpy as jnp
import numpy as np

from ._codes import Row


class TurnSamples:
    """Samples of a group as they come, and what happened between them."""

    # rows between two looks are far fewer than this; it packs three counts in one
    _SHIFT = 20

    def __init__(self, lanes: int, turns: int, skip: int, n: int):
        self._turns, self._skip = turns, skip
        # one more than there are lanes, for slots that have none
        self.states = np.full((lanes + 1, turns - skip, n), np.nan)
        # the first is for the turns skipped
        self._hits = np.zeros((lanes + 1, turns - skip + 1), dtype=int)
        self._rests = np.zeros((lanes + 1, turns - skip + 1), dtype=int)
        # stops, impacts and completed chatters of each lane so far
        self._so_far = np.zeros((3, lanes + 1), dtype=int)
        self._weight = np.zeros(max(Row) + 1, dtype=int)
        self._weight[Row.IMPACT] = 1
        self._weight[Row.LAST_IMPACT] = 1 + (1 << self._SHIFT)
        self._weight[Row.STOP] = 1 << 2 * self._SHIFT

    @staticmethod
    def row(record):
        return [jnp.asarray(v) for v in (record.kind, *record.after)]

    def take(self, work, log) -> None:
        """Put what one stretch of the slots' log shows into its places."""
        kind = log[..., 0].astype(np.int8)
        packed = np.cumsum(self._weight[kind], axis=1)
        who, row = np.nonzero(kind == Row.STOP)
        stops, hits, rests = self._unpacked(packed[who, row])
        lane = work[who]
        place = self._so_far[0, lane] + stops - self._skip
        # rounding may set the end of the run apart from its last stop
        real = (place >= 0) & (place <= self._turns - self._skip)
        at = lane[real], place[real]
        self._hits[at] = (self._so_far[1, lane] + hits)[real]
        self._rests[at] = (self._so_far[2, lane] + rests)[real]
        real &= place > 0
        self.states[lane[real], place[real] - 1] = log[who[real], row[real], 1:]
        self._so_far[:, work] += np.stack(self._unpacked(packed[:, -1]))

    def counts(self):
        """Impacts and completed chatters in each turn; 0 where a lane failed."""
        for counts in (self._hits, self._rests):
            yield np.maximum(np.diff(counts[:-1], axis=1), 0)

    def _unpacked(self, packed):
        mask = (1 << self._SHIFT) - 1
        return (
            packed >> 2 * self._SHIFT,
            packed & mask,
            (packed >> self._SHIFT) & mask,
        )
