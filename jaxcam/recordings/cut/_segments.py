"""The parts of a recording: flights, contacts, and the boundaries between them."""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float, Int

from .._drive import Drive
from .._recording import Recording
from ._surface import Surface


@dataclasses.dataclass(frozen=True)
class Boundary:
    """The boundary between one part and the next.

    - `time`, `stderr`: seconds; the error is not a number at the ends of the record.
    - `kind`: `"impact"` (flight to flight), `"several impacts"` (too close together to
        be told apart), `"landing"` (flight to contact, with
        bounces too low to be seen), `"release"` (contact to flight) or `"end of
        record"`.
    - `evidence`: why it is there, in words.
    """

    time: float
    stderr: float
    kind: str
    evidence: str


@dataclasses.dataclass(frozen=True)
class Flight:
    """Free motion from one boundary to the next; samples `first <= i < last`."""

    start: Boundary
    stop: Boundary
    first: int
    last: int
    height: float

    @property
    def duration(self) -> float:
        return self.stop.time - self.start.time


@dataclasses.dataclass(frozen=True)
class Contact:
    """A stretch within the noise of the surface; samples `first <= i < last`.

    It begins with bounces that are too low to be seen. `settled` (s) is when they have
    died out, estimated from the last flight that was seen: from there to `stop` the
    follower rests on the cam.
    """

    start: Boundary
    stop: Boundary
    first: int
    last: int
    settled: float

    @property
    def duration(self) -> float:
        return self.stop.time - self.start.time


@dataclasses.dataclass(frozen=True)
class Impacts:
    """Impacts between two flights that were both seen, one entry each.

    - `time`, `time_stderr`: seconds.
    - `angle`, `angle_stderr`: the measured channel at the impact, and the error of its
        distance from the surface.
    - `turned`: what the cam has turned (rad), or not a number without a drive.
    - `before`, `after`: rate of the channel on either side, and their errors.
    - `approach`, `separation`: speeds relative to the surface, both positive.
    - `surface_stderr`: error of the speed of the surface, which both share.
    - `flight`: index of the flight that ends here; the next one begins here.
    - `side`: which surface was hit, 0 the one below the motion, 1 the one above.
    """

    time: Float[np.ndarray, " k"]
    time_stderr: Float[np.ndarray, " k"]
    angle: Float[np.ndarray, " k"]
    angle_stderr: Float[np.ndarray, " k"]
    turned: Float[np.ndarray, " k"]
    before: Float[np.ndarray, " k"]
    before_stderr: Float[np.ndarray, " k"]
    after: Float[np.ndarray, " k"]
    after_stderr: Float[np.ndarray, " k"]
    approach: Float[np.ndarray, " k"]
    separation: Float[np.ndarray, " k"]
    surface_stderr: Float[np.ndarray, " k"]
    flight: Int[np.ndarray, " k"]
    side: Int[np.ndarray, " k"]

    @property
    def count(self) -> int:
        return len(self.time)

    @property
    def restitution(self) -> Float[np.ndarray, " k"]:
        """Measured coefficient of each impact: separation over approach speed."""
        return self.separation / self.approach

    @property
    def restitution_stderr(self) -> Float[np.ndarray, " k"]:
        """Standard error of `restitution`, from the errors of all three speeds."""
        r = self.restitution
        errors = [
            self.after_stderr,
            r * self.before_stderr,
            (1 + r) * self.surface_stderr,
        ]
        return np.sqrt(sum(error**2 for error in errors)) / self.approach


@dataclasses.dataclass(frozen=True)
class Segments:
    """A recording cut into its parts.

    - `channel`: the channel that the parts were found in.
    - `gap`: its distance from the nearest surface, `(k,)`, or `None` in free flight.
    - `noise`: standard deviation of the channel's samples.
    - `clock`: time of the model at each sample (s): record time, or that of a drive
        at constant speed.
    - `drive`, `surface`: what the gap was computed with, for a cam-follower.
    - `sure`: samples at which contact is no hidden hop, shape `(k,)`; `None`: all.
    """

    recording: Recording
    channel: str
    noise: float
    clock: Float[np.ndarray, " k"]
    flights: tuple[Flight, ...]
    contacts: tuple[Contact, ...]
    impacts: Impacts
    gap: Float[np.ndarray, " k"] | None = None
    drive: Drive | None = None
    surface: Surface | None = None
    sure: Bool[np.ndarray, " k"] | None = None

    def resting(self, contact: Contact) -> Bool[np.ndarray, " k"]:
        """Samples at which the follower rests: settled, and beyond doubt."""
        time = self.recording.time
        rows = (time >= contact.settled) & (time < contact.stop.time)
        # a release that few samples tell of may be placed after the contact
        rows[contact.last :] = False
        return rows if self.sure is None else rows & self.sure

    def sentence(self) -> str:
        """Summarise the segments in words."""
        flown = sum(flight.last - flight.first for flight in self.flights)
        rested = sum(contact.last - contact.first for contact in self.contacts)
        total = len(self.recording)
        return (
            f"{self.recording.name}: {_counted(len(self.flights), 'flight')} "
            f"({flown / total:.0%} of the time), "
            f"{_counted(self.impacts.count, 'impact')}, "
            f"{_counted(len(self.contacts), 'contact')} ({rested / total:.0%})."
        )


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def no_impacts() -> Impacts:
    """Impacts of a record that has none."""
    none = np.zeros(0)
    fields = [field.name for field in dataclasses.fields(Impacts)]
    number = none.astype(int)
    return Impacts(**dict.fromkeys(fields[:-2], none), flight=number, side=number)
