"""Segment a recording at any number of gaps, computed from any channels."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from .._drive import Drive
from .._recording import Recording
from ._cut import cut
from ._inside import refuse_inside
from ._motion import Motion
from ._placed import placed
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

    **Returns:** the segments; `impacts.side` is the index of the gap that closed, and
    `impacts.before` and `impacts.after` are its rates of change.

    **Raises:** `RecordingError` if a gap is far below zero most of the time.
    """
    none = np.zeros(len(recording))
    sides = []
    for gap, tolerance in zip(gaps, tolerances, strict=True):
        noise = measured_noise(gap)
        side = Motion(recording.time, gap, none, none, noise, recording.interval)
        sides.append(placed(side, tolerance) if tolerance > 0 else side)
    refuse_inside(recording.name, sides, tolerances)
    flights, contacts, impacts = cut(sides, restitution, doubted)
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
