"""Measure typical speeds and accelerations of a motion."""

import math
from collections.abc import Sequence

import numpy as np
from scipy.signal import savgol_filter

from .._recording import Recording


# Time (s) over which a speed is measured, so that noise is negligible; quantile of the
# speeds
_STRIDE, _SHARE = 5e-3, 0.95
# Number of samples of a parabola used to measure an acceleration
_WINDOW = 51


def fast_speed(recordings: Sequence[Recording], channel: str) -> float:
    """Return the speed of a channel that one sample in twenty exceeds, in its units per
    second; 1 for a channel at rest.
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
    """Return the magnitude of a channel's second derivative that one sample in ten
    exceeds, in its units per second squared; infinite if the recordings are too short.
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
