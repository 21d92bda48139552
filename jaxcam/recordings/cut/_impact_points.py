"""Points of a surface: impacts, found without the surface, and contacts."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from .._drive import Drive
from .._recording import Recording
from ._jump_point import jump_point
from ._kinks import find_kinks
from ._segments import Segments


# Samples of a contact from one that is used to the next
_EVERY = 8


class SurfacePoints(NamedTuple):
    """Points of a surface, shape `(k,)` each."""

    time: Float[np.ndarray, " k"]
    """Time of the impact or of the sample in contact (s)."""
    turned: Float[np.ndarray, " k"]
    """Angle of the drive at this time (rad)."""
    angle: Float[np.ndarray, " k"]
    """Value of the channel; at an impact, the one at which the motions before and after
    it meet.
    """
    error: Float[np.ndarray, " k"]
    """Standard error of `angle`."""


def impact_points(
    recording: Recording, drive: Drive, channel: str, noise: float
) -> SurfacePoints:
    """Return the points of the surface at which the velocity jumps.

    **Arguments:** `noise` is the standard deviation of a sample.
    """
    time, samples = recording.time, recording[channel]
    rows = []
    for kink in find_kinks(samples, recording.interval, noise):
        found = jump_point(time, samples, kink, recording.interval, noise)
        if found.close:
            turned = float(np.interp(found.time, time, drive.angle))
            middle = 0.5 * (found.before + found.after)
            rows.append((found.time, turned, middle, found.stderr))
    return SurfacePoints(*np.array(rows, dtype=float).reshape(-1, 4).T)


def touched_points(part: Segments) -> SurfacePoints:
    """Return the points of the surface at impacts and in contact."""
    time, impacts, noise = part.recording.time, part.impacts, part.noise
    assert part.drive is not None
    rests = [np.flatnonzero(part.resting(contact)) for contact in part.contacts]
    rows = [rest[::_EVERY] for rest in rests]
    resting = np.concatenate([np.zeros(0, dtype=int), *rows])
    sharp = impacts.time_stderr < 2 * part.recording.interval
    columns = (
        (impacts.time[sharp], time[resting]),
        (impacts.turned[sharp], part.drive.angle[resting]),
        (impacts.angle[sharp], part.recording[part.channel][resting]),
        (impacts.angle_stderr[sharp], np.full(len(resting), noise)),
    )
    return SurfacePoints(*map(np.concatenate, columns))
