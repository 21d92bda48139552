"""The content of a rig file of any system: its sensors and known values."""

import dataclasses
import fnmatch
import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Literal

import numpy as np

from ..recordings import read_case, Recording, RecordingError, Segments
from ..recordings.files import Case, FileLayout
from ._contact_in_doubt import contact_in_doubt
from ._lags import without_lags
from ._repeated_samples import repeats_noted
from ._segment_by_model import segment_by_model
from .engine import Input, Model, Parameter, Problem


@dataclasses.dataclass(frozen=True)
class Setup:
    """The content of a user's rig file, as read by `read_setup`.

    Examples:
        >>> from jaxcam.data import NEW_RIG
        >>> from jaxcam.fitting import read_setup
        >>> setup = read_setup(NEW_RIG / "cart.toml")
        >>> len(setup.parameters) > 0
        True
    """

    model: Model
    """The system at its nominal values, with its sensors and its drive."""
    parameters: tuple[Parameter, ...] = ()
    """Parameters to fit, each within its tolerance."""
    drive_channel: str | None = None
    """Channel of the encoder of a rotating drive (rad), or `None`."""
    references: Mapping[str, float] = dataclasses.field(default_factory=dict)
    """Constants in the library of effects, as stated in the rig file: keyed by the
    field names of `jaxcam.recordings.References`, in the units of the motion. Constants
    that the file does not state follow from the speeds of the motion.
    """
    records: Mapping[str, Mapping[str, float]] = dataclasses.field(default_factory=dict)
    """Known constants of individual recordings, keyed by patterns of recording names:
    `{"run3*": {"mass": 0.31}}`; if several patterns match, the last one counts.
    """
    files: FileLayout = FileLayout()
    """Column names and sampling rate of the recordings."""
    units: Mapping[str, str] = dataclasses.field(default_factory=dict)
    """Units of parameters, fitted or known, as stated in the rig file."""
    start: tuple[float, ...] = ()
    """Initial state of simulations; empty if the rig file does not give one."""

    @property
    def channels(self) -> tuple[str, ...]:
        """Return the channels that a recording must contain, starting with the motion
        sensors.
        """
        drive = self.model.drive
        measured = drive.channel if isinstance(drive, Input) else self.drive_channel
        return (*self.model.sensors, *([] if measured is None else [measured]))

    def read_case(
        self,
        folder: str | Path,
        *,
        split: str | None = None,
        gaps: Literal["refuse", "split", "mend"] = "refuse",
    ) -> Case:
        """Return the recordings in a folder, with the columns and constants of the rig.

        This is `jaxcam.recordings.read_case` with the column names and constants of the
        rig file.

        Raises:
            RecordingError: As for `read_case`; or constants belong to a recording that
                does not exist.
        """
        case = read_case(
            folder,
            channels=self.channels,
            split=split,
            gaps=gaps,
            columns=self.files.columns,
            rate=self.files.rate,
        )
        return self.known_of(case)

    def known_of(self, case: Case, *, picked: bool = False) -> Case:
        """Return the case with the constants that the rig file gives for each
        recording, and with notes on channels that repeat samples in fast motion.

        Args:
            case: The case.
            picked: Whether the case contains only some of the recordings of the rig.
                Constants of other recordings are then noted in the `meta["notes"]` of
                the first one.

        Raises:
            RecordingError: Constants belong to a recording that does not exist.
        """
        sensors = self.model.sensors
        runs = tuple(repeats_noted(self._with_known(run), sensors) for run in case)
        notes: list[str] = []
        for pattern in self.records:
            if any(_fits(run.name, pattern) for run in case):
                continue
            unused = f'[records."{pattern}"] of the rig file matches none of the'
            if not picked:
                names = ", ".join(f"`{run.name}`" for run in case)
                raise RecordingError(
                    f"{case.name}: {unused} recordings; they are {names}."
                )
            notes.append(f"{unused} given recordings, so it is not used.")
        if notes and runs:
            first = runs[0]
            meta = {**first.meta, "notes": (*first.meta.get("notes", ()), *notes)}
            runs = dataclasses.replace(first, meta=meta), *runs[1:]
        return dataclasses.replace(case, recordings=runs)

    def _with_known(self, run: Recording) -> Recording:
        found = {}
        for pattern, constants in self.records.items():
            if _fits(run.name, pattern):
                found |= constants
        # constants in the recording take precedence
        return dataclasses.replace(run, constants={**found, **run.constants})

    def segments(
        self,
        recordings: Iterable[Recording | Segments],
        *,
        progress: Callable[[float], None] | None = None,
    ) -> tuple[Segments, ...]:
        """Return recordings segmented at the gaps of the system; existing segments are
        kept.

        `progress` is called with the completed fraction of the recordings to segment.

        Raises:
            RecordingError: A channel is missing, the motion in a channel is constant,
                or a gap is not measured by any channel.
        """
        runs = tuple(
            dataclasses.replace(run, recording=self._with_known(run.recording))
            if isinstance(run, Segments)
            else self._with_known(run)
            for run in recordings
        )
        uncut = [run for run in runs if isinstance(run, Recording)]
        if not uncut:
            return tuple(run for run in runs if isinstance(run, Segments))
        for run in uncut:
            self._refuse_still(run)
        cut = iter(
            segment_by_model(
                self.model,
                uncut,
                self.parameters,
                drive_channel=self.drive_channel,
                progress=progress,
            )
        )
        return tuple(run if isinstance(run, Segments) else next(cut) for run in runs)

    def contact_in_doubt(self, segments: Iterable[Segments]) -> str:
        """Return a sentence if no recording shows an impact although the system has
        stops, or if a recording lies far beyond a stop: the unit of a column may be
        wrong. The sentence is empty if there is no such doubt.
        """
        return contact_in_doubt(self.model, self.parameters, tuple(segments))

    def _refuse_still(self, run: Recording) -> None:
        """Raise `RecordingError` for a sensor of the motion that shows no motion."""
        for name, sensor in self.model.sensors.items():
            samples = run[name]
            # the resolution is a decimal fraction, which samples do not reach exactly
            if np.ptp(samples) <= 1.001 * sensor.resolution:
                raise RecordingError(
                    f"{run.name}: the channel `{name}` is {samples[0]:g} throughout; "
                    "check that its sensor is connected, or remove this recording."
                )

    def without_lags(
        self,
        recordings: Iterable[Recording | Segments],
        lags: Mapping[str, float] = MappingProxyType({}),
    ) -> tuple["Setup", tuple[Recording | Segments, ...]]:
        """Return the setup and the recordings after `jaxcam.fitting.without_lags`;
        both are unchanged if a recording is already segmented.

        Args:
            recordings: The recordings.
            lags: Lags of channels (s) that replace those of their sensors.

        Raises:
            RecordingError: A recording is too short, or a channel is missing.
        """
        runs = tuple(recordings)
        whole = [run for run in runs if isinstance(run, Recording)]
        if len(whole) < len(runs):
            return self, runs
        model, moved = without_lags(self.model, whole, lags)
        return dataclasses.replace(self, model=model), moved

    def problem(self, recordings: Iterable[Recording | Segments]) -> Problem:
        """Return the fitting problem of recordings, segmented or not, without the long
        lags of the sensors.

        Raises:
            ValueError: As for `segments` and `Problem.build`.
        """
        setup, runs = self.without_lags(recordings)
        return Problem.build(setup.model, setup.segments(runs), self.parameters)


def _fits(name: str, pattern: str) -> bool:
    """Return whether a pattern matches a recording or a piece of it: `run3` matches
    `run3_piece2`.
    """
    whole = re.sub(r"_piece\d+$", "", name)
    return any(fnmatch.fnmatchcase(one, pattern) for one in (name, whole))
