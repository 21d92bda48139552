"""Cut recordings into short pieces, as arrays for a compiled program."""

import dataclasses
from collections.abc import Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float, Int

from ...recordings import RecordingError, Segments
from ...recordings.cut import measured_noise
from ._driven_steps import (
    drive_at,
    drive_error,
    DriveError,
    input_at,
    input_in_steps,
    mean_rates,
)
from ._model import DriveState, Input, Numbers
from ._piece_length import bearable_length


# Maximum number of samples in a piece: enough to determine its own initial state, but a
# short time compared with that over which impacts magnify an error
_PIECE = 100
# A flight with fewer samples than the first number gives no information by itself.
# Between two impacts, the second number of samples suffices: these samples determine
# the velocity of the flight, which links the flights before and after it
_LEAST, _TIED = 8, 3
# The number of samples in a step is rounded up to a multiple of this
_SHARED = 4
# The number of pieces is rounded up to a multiple of the first number, so that similar
# records share a program; if a piece has more steps than the last number, padding takes
# longer than compiling, and the second number is used
_PADDED, _LESS_PADDED, _FEW_STEPS = 64, 8, 20
# Kinds of predecessor of a piece: none, a piece of the same flight, or an impact
FREE, FLIGHT, IMPACT = 0, 1, 2
# Half-width (samples) of the search for the time of an impact about the recorded one
REACH = 20.0


class Samples(eqx.Module):
    """Samples of `k` pieces of each of `r` recordings, sorted into steps.

    Every piece is `n` steps of equal length; a step holds up to `m` samples of `c`
    channels. `place` is the position of a sample within its step (0 to 1).
    """

    start: Float[Numbers, "r k"]
    step: Float[Numbers, "r k"]
    place: Float[Numbers, "r k n m"]
    value: Float[Numbers, "r k n m c"]
    known: Bool[Numbers, "r k n m c"]


class Pieces(eqx.Module):
    """All data of the recordings that a fit needs.

    - `flown`, `rested`: samples in flight and in contact.
    - `joint`: the predecessor of each piece of flight: nothing, flight, or an impact.
    - `exists`, `rest_exists`: false for padding.
    - `drive` `(r, k, n)`: angle and acceleration of the drive in the middle of each
        step, and its mean rate; or the mean and slope of an input. `drive_at` `(r, k)`:
        motion of the drive at the beginning of each piece. `rest_drive` `(r, kc, n +
        1)`: motion of the drive at the ends of the steps of each piece in contact.
    - `reach`: largest deviation (s) of an impact from its recorded time.
    - `drive_error`: standard errors of each recording's drive.
    - `substeps` `(r,)`: number of parts into which a prediction divides each step, the
        same for all recordings.
    - `begins` `(r, k)`: index of the discrete state in which each piece begins; `None`
        if the system has only one, or outside the compiled programs.
    """

    flown: Samples
    rested: Samples
    joint: Int[Numbers, "r k"]
    exists: Bool[Numbers, "r k"]
    rest_exists: Bool[Numbers, "r kc"]
    drive: DriveState
    drive_at: DriveState
    rest_drive: DriveState
    reach: Float[Numbers, " r"]
    drive_error: DriveError
    substeps: Int[Numbers, " r"]
    begins: Int[Numbers, "r k"] | None = None

    @property
    def steps(self) -> int:
        """Number of steps in each piece."""
        return self.flown.place.shape[-2]


@dataclasses.dataclass(frozen=True)
class Span:
    """One piece: its time span, its samples, and its predecessor."""

    start: float
    stop: float
    rows: Int[np.ndarray, " k"]
    joint: int
    flight: int


def spans(
    segments: Segments, curved: Sequence[str] | None = None, rests: bool = True
) -> tuple[list[Span], list[Span]]:
    """Return the pieces of flight and of contact of one recording.

    **Arguments:** `curved` are the channels in which a piece must not be longer than
    half an oscillation (default: the segmented channel). Without `rests`, contacts are
    omitted.
    """
    record = segments.recording
    time, interval = record.time, record.interval
    valid = np.ones(len(time), bool) if record.filled is None else ~record.filled
    flown: list[Span] = []
    curved = (segments.channel,) if curved is None else curved
    noises = {name: measured_noise(record[name]) for name in curved}
    before = None
    for number, flight in enumerate(segments.flights):
        begin, end = flight.start.time, flight.stop.time
        if flight.start.kind == "end of record":
            begin = float(time[flight.first])
        first, last = (_margin(edge, interval) for edge in (flight.start, flight.stop))
        rows = np.arange(max(0, flight.first - 1), min(len(time), flight.last + 1))
        rows = rows[(time[rows] >= begin + first) & (time[rows] <= end - last)]
        joined = _sharp(flight.start, interval) and before is flight.start
        between = joined and _sharp(flight.stop, interval)
        if np.sum(valid[rows]) < (_TIED if between else _LEAST):
            before = None
            continue
        if flight.start.kind == "release":
            # the time of release is uncertain: begin with the first sample
            begin = float(time[rows[0]])
        longest = _PIECE
        for name in curved:
            samples = record[name][rows[valid[rows]]]
            noise = segments.noise if name == segments.channel else noises[name]
            longest = bearable_length(samples, noise, longest)
        count = -(-round((end - begin) / interval) // longest)
        edges = np.linspace(begin, end, max(1, count) + 1)
        where = np.clip(np.searchsorted(edges, time[rows], "right") - 1, 0, count - 1)
        for k, (a, b) in enumerate(zip(edges, edges[1:])):
            joint = FLIGHT if k else IMPACT if joined else FREE
            inside = rows[where == k]
            flown.append(Span(a, b, inside[valid[inside]], joint, number))
        before = flight.stop
    rested = []
    for number, contact in enumerate(segments.contacts if rests else ()):
        rows = np.flatnonzero(segments.resting(contact) & valid)
        # divide a contact by time, not by number of certain samples, because these may
        # be far apart
        whole = np.arange(rows[0], rows[-1] + 1) if len(rows) else rows
        for stretch in np.array_split(whole, max(1, -(-len(whole) // _PIECE))):
            block = np.intersect1d(stretch, rows, assume_unique=True)
            if len(block):
                a, b = float(time[block[0]]), float(time[block[-1]])
                rested.append(Span(a, max(b, a + interval), block, FREE, number))
    return flown, rested


def _sharp(edge, interval: float) -> bool:
    """Return whether a boundary is an impact whose time is known accurately enough for
    a joint.
    """
    return edge.kind == "impact" and bool(edge.stderr < 2 * interval)


def _margin(edge, interval: float) -> float:
    """Return the distance from a boundary within which samples may be on its other
    side.
    """
    if edge.kind == "end of record":
        return 0.0
    if edge.kind == "several impacts":
        return edge.stderr
    error = edge.stderr if np.isfinite(edge.stderr) else interval
    least = interval / 2 + 2 * min(error, 2 * interval)
    # if the margin were too small, a flight would be fitted to samples of the contact
    return max(least, error) if edge.kind == "release" else least


def gather(
    segments: Sequence[Segments],
    channels: Sequence[str],
    steps: int,
    measured: Input | None = None,
    curved: Sequence[str] | None = None,
    rests: bool = True,
    in_flight_only: Sequence[str] = (),
) -> tuple[Pieces, list[tuple[list[Span], list[Span]]]]:
    """Gather the pieces of all recordings, padded so that similar recordings share a
    compiled program.

    **Arguments:** `measured` is an input, in place of a drive; `curved` and `rests` are
    those of `spans`; the samples of the channels `in_flight_only` are
    not used in contact.

    **Raises:** `RecordingError` if there is nothing to fit.
    """
    # the curvature due to a measured input is known, so it does not limit the pieces
    curved = curved if measured is None else ()
    cuts = [spans(part, curved, rests) for part in segments]
    if not any(flown for flown, _ in cuts):
        names = ", ".join(part.recording.name for part in segments)
        raise RecordingError(
            f"{names}: there is no flight of at least {_LEAST} samples to fit; give a "
            "recording in which the motion leaves the surface, or record faster."
        )
    multiple = _PADDED if steps <= _FEW_STEPS else _LESS_PADDED
    width = multiple * -(-max(len(flown) for flown, _ in cuts) // multiple)
    # zero if there are no contacts, so that the program for contacts is not compiled
    resting = 32 * -(-max(len(rested) for _, rested in cuts) // 32)
    most = max(_most_in_a_step(part, cut, steps) for part, cut in zip(segments, cuts))
    both = [
        [
            _samples(part, cut[side], channels, size, steps, most)
            for part, cut in zip(segments, cuts)
        ]
        for side, size in ((0, width), (1, resting))
    ]
    flown, rested = (
        Samples(*(np.stack(column) for column in zip(*rows))) for rows in both
    )
    rested.known[..., [name in in_flight_only for name in channels]] = False
    records = len(segments)
    joint = np.zeros((records, width), dtype=int)
    exists = np.zeros((records, width), dtype=bool)
    rest_exists = np.zeros((records, resting), dtype=bool)
    for row, (flights, contacts) in enumerate(cuts):
        joint[row, : len(flights)] = [span.joint for span in flights]
        exists[row, : len(flights)] = True
        rest_exists[row, : len(contacts)] = True
    starts, lengths = np.asarray(flown.start), np.asarray(flown.step)
    edges = starts[..., None] + lengths[..., None] * np.arange(steps + 1)
    middle = (edges[..., 1:] + edges[..., :-1]) / 2
    nodes = rested.start[..., None] + rested.step[..., None] * np.arange(steps + 1)
    if measured is None:
        drive = drive_at(segments, middle)
        drive = drive._replace(rate=mean_rates(segments, edges))
        begin, rest = drive_at(segments, flown.start), drive_at(segments, nodes)
    else:
        drive = input_in_steps(segments, measured, edges)
        begin = input_at(segments, measured, flown.start)
        rest = input_at(segments, measured, nodes)
    pieces = Pieces(
        flown,
        rested,
        joint,
        exists,
        rest_exists,
        drive,
        begin,
        rest,
        np.array([REACH * part.recording.interval for part in segments]),
        drive_error(segments, _PIECE),
        np.ones(records, dtype=int),
    )
    return pieces, cuts


def _most_in_a_step(part: Segments, cut, steps: int) -> int:
    # rounded up, so that similar records share a program
    length = max((s.stop - s.start for side in cut for s in side), default=0.0)
    most = int(np.ceil(length / steps / part.recording.interval - 1e-9)) + 1
    return _SHARED * -(-most // _SHARED)


def _samples(part: Segments, cut: list[Span], channels, size, steps, most):
    time = part.recording.time
    start, step = np.zeros(size), np.full(size, part.recording.interval)
    shape = (size, steps, most)
    place, value = np.zeros(shape), np.zeros((*shape, len(channels)))
    known = np.zeros((*shape, len(channels)), dtype=bool)
    columns = np.stack([part.recording[channel] for channel in channels], axis=-1)
    for k, span in enumerate(cut):
        start[k], step[k] = span.start, (span.stop - span.start) / steps
        along = (time[span.rows] - span.start) / step[k]
        bins = np.clip(along.astype(int), 0, steps - 1)
        for b in np.unique(bins):
            inside = np.flatnonzero(bins == b)
            place[k, b, : len(inside)] = along[inside] - b
            value[k, b, : len(inside)] = columns[span.rows[inside]]
            known[k, b, : len(inside)] = np.isfinite(columns[span.rows[inside]])
    return start, step, place, np.where(known, value, 0.0), known
