"""The parts of a recording: flights, contacts and their boundaries."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from ...tables import counted
from .._drive import Drive
from .._recording import Recording
from ._surface import Surface


@dataclasses.dataclass(frozen=True)
class Boundary:
    """The boundary between one part and the next."""

    time: float
    """Time (s)."""
    stderr: float
    """Standard error of `time` (s), NaN at the ends of the recording."""
    kind: str
    """`"impact"` (flight to flight), `"several impacts"` (too close together to be
    distinguished), `"landing"` (flight to contact, with impacts too weak to be
    observed), `"release"` (contact to flight) or `"end of record"`.
    """
    evidence: str
    """Evidence for the boundary, as text."""


@dataclasses.dataclass(frozen=True)
class Flight:
    """Free motion from one boundary to the next; samples `first <= i < last`."""

    start: Boundary
    """The boundary at which the flight begins."""
    stop: Boundary
    """The boundary at which the flight ends."""
    first: int
    """Index of the first sample."""
    last: int
    """Index after the last sample."""
    height: float
    """Largest distance from the surface."""

    @property
    def duration(self) -> float:
        """Length of the flight (s)."""
        return self.stop.time - self.start.time


@dataclasses.dataclass(frozen=True)
class Contact:
    """An interval during which the distance from the surface is within the noise.

    It consists of the samples `first <= i < last`, and it begins with impacts that are
    too weak to be observed.
    """

    start: Boundary
    """The boundary at which the contact begins."""
    stop: Boundary
    """The boundary at which the contact ends."""
    first: int
    """Index of the first sample."""
    last: int
    """Index after the last sample."""
    settled: float
    """Time (s) at which the impacts have decayed, estimated from the last observed
    flight: from then until `stop`, the follower is in contact with the cam.
    """

    @property
    def duration(self) -> float:
        """Length of the contact (s)."""
        return self.stop.time - self.start.time


@dataclasses.dataclass(frozen=True)
class Impacts:
    """Impacts between two observed flights, one entry each."""

    time: Float[np.ndarray, " k"]
    """Time (s)."""
    time_stderr: Float[np.ndarray, " k"]
    """Standard error of `time` (s)."""
    angle: Float[np.ndarray, " k"]
    """The measured channel at the impact."""
    angle_stderr: Float[np.ndarray, " k"]
    """Standard error of the channel's distance from the surface."""
    turned: Float[np.ndarray, " k"]
    """Angle of the cam (rad); NaN without a drive."""
    before: Float[np.ndarray, " k"]
    """Rate of change of the channel before the impact."""
    before_stderr: Float[np.ndarray, " k"]
    """Standard error of `before`."""
    after: Float[np.ndarray, " k"]
    """Rate of change of the channel after the impact."""
    after_stderr: Float[np.ndarray, " k"]
    """Standard error of `after`."""
    approach: Float[np.ndarray, " k"]
    """Speed relative to the surface before the impact, positive."""
    separation: Float[np.ndarray, " k"]
    """Speed relative to the surface after the impact, positive."""
    surface_stderr: Float[np.ndarray, " k"]
    """Standard error of the surface speed, common to `approach` and `separation`."""
    flight: Int[np.ndarray, " k"]
    """Index of the flight that ends at the impact; the next flight begins there."""
    side: Int[np.ndarray, " k"]
    """Surface that was hit: 0 for the lower one, 1 for the upper one."""

    @property
    def count(self) -> int:
        """Number of impacts."""
        return len(self.time)

    @property
    def restitution(self) -> Float[np.ndarray, " k"]:
        """Measured coefficient of each impact: separation speed divided by approach
        speed.
        """
        return self.separation / self.approach

    @property
    def restitution_stderr(self) -> Float[np.ndarray, " k"]:
        """Standard error of `restitution`, from the errors of the approach, separation
        and surface speeds.
        """
        r = self.restitution
        errors = [
            self.after_stderr,
            r * self.before_stderr,
            (1 + r) * self.surface_stderr,
        ]
        return np.sqrt(sum(error**2 for error in errors)) / self.approach


@dataclasses.dataclass(frozen=True)
class Segments:
    """A segmented recording.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.recordings import Recording, segment
        >>> ball, time = BouncingBall(), np.linspace(0.0, 1.0, 1001)
        >>> motion = jaxcam.simulate(ball, [1.0, 0.0], 0.0, 1.0)
        >>> height = np.random.default_rng(0).normal(motion.at(time)[:, 0], 1e-4)
        >>> run = Recording("run", time, {"height_m": height})
        >>> parts = segment(run, "height_m", 0.0)
        >>> len(parts.flights)
        2
    """

    recording: Recording
    """The recording."""
    channel: str
    """The segmented channel."""
    noise: float
    """Standard deviation of the channel's samples."""
    clock: Float[np.ndarray, " k"]
    """Time of the model at each sample (s): the time of the recording, or the time at
    which a drive of constant speed has the measured angle.
    """
    flights: tuple[Flight, ...]
    """The flights."""
    contacts: tuple[Contact, ...]
    """The contacts."""
    impacts: Impacts
    """The impacts between two observed flights."""
    gap: Float[np.ndarray, " k"] | None = None
    """Distance from the nearest surface, shape `(k,)`; `None` without a surface."""
    drive: Drive | None = None
    """Measured drive of a cam-follower, from which the gap was computed."""
    surface: Surface | None = None
    """Surface of a cam-follower's cam, from which the gap was computed."""
    sure: Bool[np.ndarray, " k"] | None = None
    """For each sample, whether a flight too low to be observed can be excluded, shape
    `(k,)`; `None` if it can be excluded for all samples.
    """

    def resting(self, contact: Contact) -> Bool[np.ndarray, " k"]:
        """Return the samples at which the follower is certainly in settled contact."""
        time = self.recording.time
        rows = (time >= contact.settled) & (time < contact.stop.time)
        # a release with few samples may be located after the contact
        rows[contact.last :] = False
        return rows if self.sure is None else rows & self.sure

    def sentence(self) -> str:
        """Return a summary of the segments in words."""
        flown = sum(flight.last - flight.first for flight in self.flights)
        rested = sum(contact.last - contact.first for contact in self.contacts)
        total = len(self.recording)
        return (
            f"{self.recording.name}: {counted(len(self.flights), 'flight')} "
            f"({flown / total:.0%} of the time), "
            f"{counted(self.impacts.count, 'impact')}, "
            f"{counted(len(self.contacts), 'contact')} ({rested / total:.0%})."
        )


def impacts_of(found: Sequence[tuple[dict, int]]) -> Impacts:
    """Return impacts in arrays, given the numbers of each and of the flight before."""
    numbers = {"flight", "side"}
    names = [f.name for f in dataclasses.fields(Impacts) if f.name not in numbers]
    columns = {name: np.array([row[name] for row, _ in found]) for name in names}
    return Impacts(
        **columns,
        flight=np.array([n for _, n in found], dtype=int),
        side=np.array([row["side"] for row, _ in found], dtype=int),
    )
