"""Range of the motion in recordings, measured by one channel."""

import math
from collections.abc import Sequence

import numpy as np

from ...fitting import Sensor
from ...recordings import Recording
from ...recordings.cut import fast_speed, usual_acceleration
from ..terms import MotionScales


def motion_scales(
    runs: Sequence[Recording], channel: str, sensor: Sensor, slip: float
) -> MotionScales:
    """Return the scales of position, speed and acceleration of the coordinate that a
    channel measures.

    **Arguments:** `slip`: the speed over which dry friction changes sign.
    """
    samples = np.concatenate([run[channel] for run in runs])
    offset, gain = float(sensor.offset), float(sensor.gain)
    places = (samples[np.isfinite(samples)] - offset) / gain
    low, high = float(np.min(places)), float(np.max(places))
    fast = fast_speed(runs, channel) / abs(gain)
    push = usual_acceleration(runs, channel) / abs(gain)
    if not (math.isfinite(push) and push > 0):
        # the recordings are too short for an acceleration: assume that the range is
        # crossed at the speed `fast`
        push = fast**2 / max(high - low, 1e-300)
    return MotionScales(low, high, fast, push, slip)
