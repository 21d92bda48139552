"""Remove long lags of sensors from recordings, by whole samples."""

import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from ..recordings import Recording
from .engine import Model


# intervals of two recordings that differ by less than this fraction are equal
_EQUAL = 1e-6


def without_lags(
    model: Model,
    recordings: Sequence[Recording],
    lags: Mapping[str, float] = MappingProxyType({}),
) -> tuple[Model, tuple[Recording, ...]]:
    """Return recordings in which the samples of lagging channels have been moved to
    earlier times, and the model of these recordings.

    A fit expands the motion in powers of the lag, which fails if the lag is not short
    compared with the time scale of the motion, or if it contains an impact. A lag of
    two or more sampling intervals is therefore removed as far as whole intervals allow,
    which neither interpolates nor correlates the samples. The lags of the model remain
    total lags.

    Args:
        model: The model, with its sensors.
        recordings: The recordings. If their intervals differ, they are unchanged.
        lags: Lags of channels (s) that replace those of their sensors.

    Returns:
        The model and the recordings.

    Raises:
        RecordingError: A recording is too short, or a channel is missing.

    Examples:
        >>> from jaxcam.fitting import Model, Sensor, without_lags
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.recordings import Recording
        >>> run = Recording("run", 1e-3 * np.arange(9.0), {"height_m": np.ones(9)})
        >>> model = Model(BouncingBall(), {"height_m": Sensor(0, noise=1e-3)})
        >>> model, (moved,) = without_lags(model, [run], {"height_m": 3.2e-3})
        >>> len(moved), round(float(model.sensors["height_m"].removed_lag), 6)
        (6, 0.003)
    """
    runs, sensors = tuple(recordings), dict(model.sensors)
    given = {n: float(s.lag) for n, s in sensors.items()} | dict(lags)
    intervals = np.array([run.interval for run in runs])
    if not runs or np.ptp(intervals) > _EQUAL * intervals[0]:
        return model, runs
    interval = float(np.mean(intervals))
    for channel, lag in given.items():
        removed = float(sensors[channel].removed_lag)
        whole = round((lag - removed) / interval)
        if whole > 1:
            runs = tuple(run.earlier(channel, whole) for run in runs)
            sensors[channel] = dataclasses.replace(
                sensors[channel], removed_lag=removed + whole * interval
            )
    return dataclasses.replace(model, sensors=sensors), runs
