"""Recordings of the cam-follower with an effect. Needs numba (extra `bench`)."""

import math
from collections.abc import Sequence

import numpy as np

from benchmarks import _cam_with_effects
from benchmarks._hidden_physics import by_kind, Hidden
from benchmarks._hidden_records import SETTLE
from benchmarks._numba_rig import Samples
from benchmarks._own_rig_makers import Motion
from benchmarks.coverage import recording
from benchmarks.fresh import DURATION, SPANS_RPM
from jaxcam.recordings import Recording


_INTERVAL = 5e-4


def made(rig, truth, rng, hidden: Sequence[Hidden]) -> list[tuple[Recording, Motion]]:
    """One recording for each range of speeds, and the motions behind them."""
    kinds = by_kind(hidden)
    return [
        _record(rig, truth, rng, kinds, f"run{run}", span)
        for run, span in enumerate(SPANS_RPM, start=1)
    ]


def _record(rig, truth, rng, hidden, name: str, span):
    speed = rng.uniform(*span) * math.pi / 30
    rows, struck = _cam_with_effects.run(
        truth, hidden, speed, DURATION, SETTLE, _INTERVAL
    )
    turned, angle, velocity = rows.T
    time = _INTERVAL * np.arange(len(rows))
    shown = angle
    if "sensor" in hidden:
        shown = angle + hidden["sensor"].at(angle, velocity, turned, time)
    states = np.stack([angle, velocity], axis=1)
    motion = Motion(time, states, turned, speed / (2 * math.pi), struck)
    return recording(Samples(time, turned, shown), rig.sensors, name, rng), motion
