"""Simulate a model from its inputs alone, and compare it with a recording."""

import dataclasses
from collections.abc import Mapping

import numpy as np
from jaxtyping import Float

from ..recordings import Recording, Segments
from ._free_run_motion import EVENTS, prepared, simulated
from .engine import Model, with_constants


@dataclasses.dataclass(frozen=True)
class FreeRun:
    """A recording, and its prediction from the first samples and the input alone."""

    record: str
    """Name of the recording."""
    time: Float[np.ndarray, " k"]
    """Times of the samples (s)."""
    measured: Mapping[str, Float[np.ndarray, " k"]]
    """Samples of each channel."""
    simulated: Mapping[str, Float[np.ndarray, " k"]]
    """Predicted samples of each channel."""
    state: Float[np.ndarray, " n"]
    """Initial state."""
    samples: int
    """Number of samples from which the initial state was estimated; the error excludes
    them.
    """

    @property
    def rmse(self) -> dict[str, float]:
        """Root-mean-square difference of each channel, in its unit, after the first
        `samples`.
        """
        return {
            name: float(np.sqrt(np.nanmean(self.residual(name)[self.samples :] ** 2)))
            for name in self.simulated
        }

    def residual(self, channel: str) -> Float[np.ndarray, " k"]:
        """Return the measured minus the simulated samples."""
        return self.measured[channel] - self.simulated[channel]


def free_run(
    model: Model, recording: Recording | Segments, *, samples: int = 20
) -> FreeRun:
    """Simulate a complete recording from its first samples and its input.

    The initial state is the one whose motion best fits the first `samples` samples.
    From there on, the simulation uses only the measured input, so errors accumulate.
    System-identification benchmarks use this test; a fit tests a model piece by piece.

    Args:
        model: A system with its sensors and its input, such as `found.model()`.
        recording: An evenly sampled recording; its `constants` are used for the system.
        samples: Number of samples from which the initial state is estimated.

    Returns:
        A `FreeRun`.

    Raises:
        RecordingError: The recording is too short, unevenly sampled or lacks a channel.
        ValueError: The model has a rotating drive, or the motion meets a constraint,
            does not stay finite, has too many switching events between two samples, or
            is too fast for the sampling interval.

    Examples:
        >>> from jaxcam.fitting import free_run, Model, Sensor
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.recordings import Recording
        >>> time = 1e-3 * np.arange(200)
        >>> fallen = Recording("drop", time, {"height_m": 1.0 - 4.905 * time**2})
        >>> model = Model(BouncingBall(), {"height_m": Sensor(0, noise=1e-4)})
        >>> free_run(model, fallen).rmse["height_m"] < 1e-9
        True
    """
    one = prepared(model, recording, samples)
    run = recording.recording if isinstance(recording, Segments) else recording
    found = simulated(with_constants(model, run), one)
    channels = np.asarray(found.channels)
    if not np.all(np.isfinite(channels)):
        raise ValueError(
            f"{run.name}: the free run diverges; check the signs of the "
            f"model's damping and stiffness."
        )
    below = np.flatnonzero(np.asarray(found.gap) < 0)
    if len(below):
        raise ValueError(
            f"{run.name}: the free run meets a constraint at "
            f"{run.time[below[0]]:.4g} s; free runs cannot contain impacts, so use "
            f"`jaxcam.simulate` instead."
        )
    crowded = np.flatnonzero(np.asarray(found.events)[:-1] >= EVENTS)
    if len(crowded):
        raise ValueError(
            f"{run.name}: the free run has at least {EVENTS} switching events between "
            f"the sample at {run.time[crowded[0]]:.4g} s and the next, too many to be "
            f"located; give a recording with shorter sampling intervals."
        )
    data = np.asarray(one.data)
    return FreeRun(
        run.name,
        run.time,
        {name: data[:, k] for k, name in enumerate(model.sensors)},
        {name: channels[:, k] for k, name in enumerate(model.sensors)},
        np.asarray(one.state),
        samples,
    )
