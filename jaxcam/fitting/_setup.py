"""A rig of any kind: its system, what is measured of it, and what is known of it."""

import dataclasses
from collections.abc import Iterable, Mapping

from ..recordings import Recording, Segments
from ._segment_by_model import segment_by_model
from .engine import Input, Model, Parameter, Problem


@dataclasses.dataclass(frozen=True)
class Setup:
    """What a rig file says of a system of one's own; `read_setup` reads it.

    - `model`: the system at its nominal values, with its sensors and its drive.
    - `parameters`: what is fitted, each within its tolerance.
    - `drive_channel`: of the encoder of a turning drive (rad), or `None`.
    - `references`: constants of the forms of missing physics that are stated, by the
        names of fields of `jaxcam.recordings.References`, in the units of the motion;
        the others follow its speeds.
    """

    model: Model
    parameters: tuple[Parameter, ...] = ()
    drive_channel: str | None = None
    references: Mapping[str, float] = dataclasses.field(default_factory=dict)

    @property
    def channels(self) -> tuple[str, ...]:
        """What a recording must contain, the sensors of the motion first."""
        drive = self.model.drive
        measured = drive.channel if isinstance(drive, Input) else self.drive_channel
        return (*self.model.sensors, *([] if measured is None else [measured]))

    def segments(
        self, recordings: Iterable[Recording | Segments]
    ) -> tuple[Segments, ...]:
        """Recordings cut at the gaps of the system; those that are all cut stay.

        **Raises:** `RecordingError` for a channel that is missing, or a gap that no
        channel shows.
        """
        runs = tuple(recordings)
        cut = tuple(run for run in runs if isinstance(run, Segments))
        if len(cut) == len(runs):
            return cut
        whole = [run.recording if isinstance(run, Segments) else run for run in runs]
        return segment_by_model(
            self.model, whole, self.parameters, drive_channel=self.drive_channel
        )

    def problem(self, recordings: Iterable[Recording | Segments]) -> Problem:
        """Recordings, cut already or not, ready to be fitted.

        **Raises:** as `segments` and `Problem.build` do.
        """
        return Problem.build(self.model, self.segments(recordings), self.parameters)
