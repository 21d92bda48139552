"""Samples of batch elements once per period, and counts of events between samples."""

import jax.numpy as jnp
import numpy as np

from ..codes import RowKind
from ..loop import loop_state
from ._table import Table


class TurnSamples:
    """Samples of a group of batch elements, and counts of events between samples."""

    def __init__(self, lanes: int, turns: int, skip: int, n: int):
        # the first place is the sample at the end of the skipped periods
        self.table = Table(_row, lanes, turns - skip + 1, 2 + n, skip)

    @property
    def states(self):
        return self.table.numbers[:, 1:, 2:]

    def counts(self):
        """Return the numbers of impacts and of completed chatter sequences in each
        sampled period; 0 where an element failed.
        """
        so_far = np.nan_to_num(self.table.numbers[..., :2]).astype(int)
        each = np.maximum(np.diff(so_far, axis=1), 0)
        return each[..., 0], each[..., 1]


def _row(record, lane):
    """Return the stop number, the numbers of impacts and of completed chatter sequences
    so far, and the state.
    """
    state = loop_state(lane)
    stop = jnp.where(record.kind == float(RowKind.STOP), state.stops, -1.0)
    return stop, [state.impacts, state.chatters, *record.after]
