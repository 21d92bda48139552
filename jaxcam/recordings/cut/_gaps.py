"""Segment a recording at any number of gaps, computed from any channels."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from .._drive import Drive
from .._recording import Recording
from ._cut import cut
from ._gap_rate import GapRate
from ._given_impacts import given_places, GivenImpacts
from ._inside import refuse_inside
from ._motion import Motion
from ._placed import jump_gaps, JumpGaps, placed
from ._polynomial import measured_noise
from ._segments import Segments


def segment_gaps(
    recording: Recording,
    channel: str,
    gaps: Float[np.ndarray, "g k"],
    tolerances: Sequence[float],
    *,
    drive: Drive | None = None,
    restitution: float = 0.5,
    doubted: Sequence[tuple[int, int]] = (),
    rates: Sequence[Float[np.ndarray, " k"] | None] | None = None,
    given: GivenImpacts | None = None,
    names: Sequence[str] = (),
) -> Segments:
    """Segment a recording at the impacts at each gap, given the gaps at every sample.

    There may be any number of bodies and surfaces; an impact at one gap ends the flight
    of all bodies.

    **Arguments:**

    - `recording`, and the `channel` that represents its motion in tables.
    - `gaps`: the gaps, positive when open.
    - `tolerances`: largest constant error of each gap, in its own units. Within this
        tolerance, the gap is shifted to zero at the impacts.
    - `drive`: the drive of the system, if it has one.
    - `restitution`: expected value, for impacts too weak to be observed.
    - `doubted`: stretches of samples (the first, and one past the last) that a model of
        the flight does not describe; an impact is sought there.
    - `rates`: for each gap, its measured rate of change at every sample, or `None` if
        it is not measured.
    - `given`: the impacts, if a model of the flights has located them.
    - `names`: the names of the gaps in messages, by default their numbers.

    **Returns:** the segments; `impacts.side` is the index of the gap that closed, and
    `impacts.before` and `impacts.after` are its rates of change.

    **Raises:** `RecordingError` if a gap is far below zero most of the time.
    """
    sides = _sides(recording, gaps, tolerances, rates, given)
    refuse_inside(recording.name, sides, tolerances, names)
    flights, contacts, impacts = cut(sides, restitution, doubted, given)
    return Segments(
        recording,
        channel,
        measured_noise(recording[channel]),
        recording.time,
        flights,
        contacts,
        impacts,
        gap=np.min([side.gap for side in sides], axis=0),
        drive=drive,
    )


def given_contacts(
    recording: Recording,
    gaps: Float[np.ndarray, "g k"],
    tolerances: Sequence[float],
    given: GivenImpacts,
) -> list[tuple[int, int]]:
    """Return the stretches of samples in contact, if the impacts are given; see
    `segment_gaps`.
    """
    sides = _sides(recording, gaps, tolerances, None, given)
    return sorted(given_places(sides, given)[0])


def gap_jumps(
    time: Float[np.ndarray, " k"], gap: Float[np.ndarray, " k"], interval: float
) -> JumpGaps:
    """Return the jumps in the rate of change of a gap, given at every sample."""
    none = np.zeros(len(time))
    return jump_gaps(Motion(time, gap, none, none, measured_noise(gap), interval))


def _sides(recording, gaps, tolerances, rates, given) -> list[Motion]:
    """Return the motion relative to each surface."""
    none = np.zeros(len(recording))
    sides = []
    rates = [None] * len(gaps) if rates is None else rates
    time, interval = recording.time, recording.interval
    for gap, tolerance, rate in zip(gaps, tolerances, rates, strict=True):
        seen = None if rate is None else GapRate.of(time, rate, gap, interval)
        noise = measured_noise(gap)
        side = Motion(time, gap, none, none, noise, interval, seen=seen)
        if tolerance > 0 and given is None:
            side = placed(side, tolerance)
        elif tolerance > 0 and given is not None:
            side = given.placed(len(sides), side, tolerance)
        sides.append(side)
    return sides
