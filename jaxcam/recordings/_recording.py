"""Recordings (sensor data) and cases (folders of recordings)."""

import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from ._errors import RecordingError


@dataclasses.dataclass(frozen=True)
class Recording:
    """One recording of a rig, in SI units.

    Examples:
        >>> from jaxcam.recordings import Recording
        >>> run = Recording("run", np.linspace(0, 1, 11), {"height_m": np.zeros(11)})
        >>> run.duration, round(run.interval, 3)
        (1.0, 0.1)
    """

    name: str
    """Name of the recording, used in tables and messages."""
    time: Float[np.ndarray, " k"]
    """Times of the samples (s), strictly increasing, shape `(k,)`."""
    channels: Mapping[str, Float[np.ndarray, " k"]]
    """Measured quantities, each of shape `(k,)`. Names end with the unit:
    `follower_angle_rad`, `gyro_rad_s`, `height_m`.
    """
    nominal_speed: float | None = None
    """Speed of the drive according to the file name (rad/s), or `None`."""
    meta: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    """Additional information, such as the file."""
    constants: Mapping[str, float] = dataclasses.field(default_factory=dict)
    """Known constants of this recording, keyed by the names of the system's fields:
    `{"mass": 0.31}`. A fit does not change them.
    """
    filled: Bool[np.ndarray, " k"] | None = None
    """Samples that `mend` interpolated, shape `(k,)`: they keep the sampling uniform,
    but no fit uses them. `None` if there are none.
    """

    def __getitem__(self, channel: str) -> Float[np.ndarray, " k"]:
        """Return the samples of one channel, shape `(k,)`.

        Raises:
            RecordingError: The channel is missing; the message lists the channels.
        """
        if channel not in self.channels:
            raise RecordingError(
                f"{self.name}: there is no channel `{channel}`; this recording has "
                f"{_listed(self.channels)}."
            )
        return self.channels[channel]

    def __len__(self) -> int:
        return len(self.time)

    @property
    def interval(self) -> float:
        """Median time between samples (s)."""
        return float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """Time between the first and the last sample (s)."""
        return float(self.time[-1] - self.time[0])

    def between(self, start: float, stop: float) -> "Recording":
        """Return the part with `start <= time < stop`, under the same name.

        Raises:
            RecordingError: Fewer than two samples remain.

        Examples:
            >>> from jaxcam.recordings import Recording
            >>> run = Recording("run", np.arange(10.0), {"height_m": np.arange(10.0)})
            >>> run.between(2.0, 5.0).time.tolist()
            [2.0, 3.0, 4.0]
        """
        keep = (self.time >= start) & (self.time < stop)
        if keep.sum() < 2:
            raise RecordingError(
                f"{self.name}: there are fewer than two samples between {start:g} s "
                f"and {stop:g} s; the recording runs from {self.time[0]:g} s to "
                f"{self.time[-1]:g} s."
            )
        channels = {name: samples[keep] for name, samples in self.channels.items()}
        filled = None if self.filled is None else self.filled[keep]
        return dataclasses.replace(
            self, time=self.time[keep], channels=channels, filled=filled
        )

    def earlier(self, channel: str, samples: int) -> "Recording":
        """Return the recording with the samples of one channel moved to earlier times.

        Args:
            channel: The channel, such as that of a sensor with a lag.
            samples: Number of intervals by which the samples are moved, not negative.
                The recording becomes shorter by as many samples.

        Raises:
            RecordingError: The channel is missing, or fewer than two samples remain.

        Examples:
            >>> from jaxcam.recordings import Recording
            >>> times, heights = np.arange(4.0), np.array([0.0, 0.0, 1.0, 2.0])
            >>> run = Recording("run", times, {"height_m": heights})
            >>> run.earlier("height_m", 1)["height_m"].tolist()
            [0.0, 1.0, 2.0]
        """
        moved, count = self[channel], len(self) - samples
        if count < 2:
            raise RecordingError(
                f"{self.name}: a lag of {samples} samples leaves fewer than two of "
                f"{len(self)}; check the lag."
            )
        channels = {name: one[:count] for name, one in self.channels.items()}
        channels[channel] = moved[samples:]
        filled = self.filled
        if filled is not None:
            # a sample is complete only if all its parts are
            filled = filled[:count] | filled[samples:]
        return dataclasses.replace(
            self, time=self.time[:count], channels=channels, filled=filled
        )


@dataclasses.dataclass(frozen=True)
class Case:
    """Several recordings of the same rig, usually one folder of files."""

    name: str
    """Name of the case."""
    recordings: tuple[Recording, ...]
    """The recordings."""
    folder: Path | None = None
    """Folder from which they were read."""

    def __iter__(self) -> Iterator[Recording]:
        return iter(self.recordings)

    def __len__(self) -> int:
        return len(self.recordings)

    def __getitem__(self, index: int | str) -> Recording:
        """Return a recording by its index, its name, or the start of its name
        (`"run4"`).

        Raises:
            RecordingError: The name is none of them, and not the start of exactly one.
        """
        if isinstance(index, int):
            return self.recordings[index]
        same = [run for run in self.recordings if run.name == index]
        if same:
            return same[0]
        found = [run for run in self.recordings if run.name.startswith(index)]
        if len(found) != 1:
            names = _listed(run.name for run in self.recordings)
            raise RecordingError(
                f"{self.name}: {len(found)} names begin with `{index}`; the "
                f"recordings are {names}."
            )
        return found[0]


def _listed(names) -> str:
    return ", ".join(f"`{name}`" for name in names) or "none"
