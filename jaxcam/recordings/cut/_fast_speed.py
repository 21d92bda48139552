"""Measure the speed of a motion, and its rate of change."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.signal import savgol_filter

from .._recording import Recording


# Time (s) over which a speed is measured, so that noise is none; share of the speeds
# that are lower
_STRIDE, _SHARE = 5e-3, 0.95
# Samples of a parabola that shows an acceleration
_WINDOW = 51


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


def usual_acceleration(recordings: Sequence[Recording], channel: str) -> float:
    """A size of a channel's second derivative that one sample in ten exceeds.

    In its units a second squared; infinite where the records are too short to show it.
    """
    found = []
    for recording in recordings:
        samples = recording[channel]
        if len(samples) >= _WINDOW:
            step = recording.interval
            bent = np.asarray(savgol_filter(samples, _WINDOW, 2, 2, step))
            found.append(np.abs(bent[np.isfinite(bent)]))
    every = np.concatenate(found) if found else np.empty(0)
    return float(np.quantile(every, 0.9)) if len(every) else math.inf
