"""How fast a motion is."""

from collections.abc import Sequence

import numpy as np

from .._recording import Recording


# Time (s) over which a speed is measured, so that noise is none; share of the speeds
# that are lower
_STRIDE, _SHARE = 5e-3, 0.95


def fast_speed(recordings: Sequence[Recording], channel: str) -> float:
    """A speed of a channel that one sample in twenty exceeds, in its units a second.

    One where the channel stands still.
    """
    speeds = []
    for recording in recordings:
        stride = max(1, round(_STRIDE / recording.interval))
        time, samples = recording.time[::stride], recording[channel][::stride]
        speeds.append(np.abs(np.diff(samples) / np.diff(time)))
    every = np.concatenate(speeds)
    fast = float(np.quantile(every[np.isfinite(every)], _SHARE))
    return fast if fast > 0 else 1.0
