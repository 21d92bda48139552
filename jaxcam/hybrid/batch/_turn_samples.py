"""Samples of many lanes once a turn, and what happened in between."""

import jax.numpy as jnp
import numpy as np

from ..codes import RowKind


class TurnSamples:
    """Samples of a group as they come, and what happened between them."""

    def __init__(self, lanes: int, turns: int, skip: int, n: int):
        self._skip = skip
        self.states = np.full((lanes, turns - skip, n), np.nan)
        # impacts and completed chatters so far; the first is for the turns skipped
        self._so_far = np.zeros((lanes, turns - skip + 1, 2), dtype=int)

    @staticmethod
    def row(record, lane):
        # the number of a stop, 0 for whatever else happened
        stop = jnp.where(record.kind == float(RowKind.STOP), lane.stops, 0.0)
        return [stop, lane.impacts, lane.chatters, *map(jnp.asarray, record.after)]

    def take(self, work, log) -> None:
        """Put what one stretch of the slots' log shows into its places."""
        stop, impacts, chatters, *state = [part.ravel() for part in log]
        at = np.flatnonzero(stop)
        lane, place = work[at % len(work)], stop[at].astype(int) - self._skip
        # rounding may set the end of the run apart from its last stop
        places = self._so_far.shape[1]
        real = (place >= 0) & (place < places)
        at, lane, place = at[real], lane[real], place[real]
        # one index into all lanes and turns is quicker than two
        counts = self._so_far.reshape(-1, 2)
        counts[lane * places + place] = np.stack([impacts[at], chatters[at]], axis=1)
        kept = place > 0
        samples = self.states.reshape(-1, len(state))
        found = np.stack([part[at[kept]] for part in state], axis=1)
        samples[lane[kept] * (places - 1) + place[kept] - 1] = found

    def counts(self):
        """Impacts and completed chatters in each turn; 0 where a lane failed."""
        each = np.maximum(np.diff(self._so_far, axis=1), 0)
        return each[..., 0], each[..., 1]
