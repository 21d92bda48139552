"""Repair faults in recordings: dropped samples and encoder slips."""

import dataclasses

import numpy as np
from jaxtyping import Float

from ...tables import counted
from .._errors import RecordingError
from .._recording import Recording
from .._saturated import saturated


# Longest gap (samples) that is bridged; over it, the motion is nearly a parabola
_BRIDGE = 4


@dataclasses.dataclass(frozen=True)
class Mended:
    """Pieces of a repaired recording, and the repairs as text.

    Interpolated samples are marked in `filled` of each piece: they keep the sampling
    uniform, but no fit uses them.
    """

    recordings: tuple[Recording, ...]
    """The pieces."""
    notes: tuple[str, ...]
    """The repairs, one sentence each."""


def mend(recording: Recording, *, bridge: int = _BRIDGE) -> Mended:
    """Repair faults of the clock or of an encoder in a recording, and note saturation
    of a gyro.

    - Dropped samples: up to `bridge` in a row are interpolated (and marked); at a
      longer gap the recording is split.
    - An encoder (`..._rad`) that slips by whole revolutions is corrected.
    - Saturated samples of a rate (`..._rad_s`) are counted; a fit treats them as
        saturated if the `Sensor` has that limit.

    Args:
        recording: The recording.
        bridge: Maximum number of consecutive missing samples to interpolate.

    Returns:
        A [`jaxcam.recordings.files.Mended`][].

    Raises:
        RecordingError: Time does not increase, or no piece is long enough.

    Examples:
        >>> from jaxcam.recordings import Recording, mend
        >>> time = np.delete(np.linspace(0, 1, 101), 50)
        >>> mended = mend(Recording("run", time, {"angle_rad": time}))
        >>> len(mended.recordings[0].time)
        101
    """
    notes: list[str] = []
    channels = dict(recording.channels)
    for name in channels:
        if name.endswith("_rad"):
            channels[name] = _unslipped(recording, name, bridge, notes)
        elif name.endswith("_rad_s"):
            _count_saturated(recording, name, notes)
    whole = dataclasses.replace(recording, channels=channels)
    pieces = _bridged(whole, bridge, notes)
    if not pieces:
        raise RecordingError(
            f"{recording.name}: no piece between gaps has {2 * bridge} samples; "
            "repeat the recording."
        )
    return Mended(tuple(pieces), tuple(notes))


def _unslipped(
    recording: Recording, name: str, bridge: int, notes
) -> Float[np.ndarray, " k"]:
    samples = recording.channels[name]
    steps = np.diff(samples)
    # usual change of the angle between two samples
    usual = np.median(steps)
    turns = np.round((steps - usual) / (2 * np.pi))
    # a jump across a gap at which the recording is split is no slip: the drive keeps
    # turning
    turns[np.diff(recording.time) > (bridge + 1.5) * recording.interval] = 0
    places = np.flatnonzero(turns)
    if not len(places):
        return samples
    unslipped = samples - 2 * np.pi * np.concatenate([[0.0], np.cumsum(turns)])
    if np.ptp(samples) <= 2 * np.pi and np.ptp(unslipped) > 2 * np.pi:
        # an angle that is reset every turn is not a fault, so no repair is noted
        return unslipped
    first = recording.time[places[0] + 1]
    total = (
        "a turn" if np.sum(np.abs(turns)) == 1 else f"{np.sum(np.abs(turns)):g} turns"
    )
    where = f"at {first:.4f} s" if len(places) == 1 else f"first at {first:.4f} s"
    notes.append(
        f"{recording.name}: `{name}` jumps by {total} {where}; the jump was removed."
    )
    return unslipped


def _count_saturated(recording: Recording, name: str, notes) -> None:
    samples = recording.channels[name]
    at_limit = saturated(samples)
    if np.any(at_limit):
        notes.append(
            f"{recording.name}: `{name}` is saturated at "
            f"{np.max(np.abs(samples)):.4g} in "
            f"{np.mean(at_limit):.1%} of its samples."
        )


def _bridged(recording: Recording, bridge: int, notes) -> list[Recording]:
    time, interval = recording.time, recording.interval
    if np.any(np.diff(time) <= 0):
        row = int(np.flatnonzero(np.diff(time) <= 0)[0])
        raise RecordingError(
            f"{recording.name}: time does not increase after {time[row]:.6g} s; sort "
            f"the rows, or keep one of those with the same time."
        )
    missing = np.round(np.diff(time) / interval).astype(int) - 1
    breaks = np.flatnonzero(missing > bridge) + 1
    filled_total = int(np.sum(missing[(missing > 0) & (missing <= bridge)]))
    if filled_total:
        share = filled_total / (filled_total + len(time))
        notes.append(
            f"{recording.name}: {counted(filled_total, 'sample')} "
            f"({100 * share:.2g} %) {'is' if filled_total == 1 else 'are'} missing; "
            "values are interpolated to keep the sampling uniform, but no fit uses "
            "them."
        )
    for place in breaks:
        last, length = time[place - 1], (time[place] - time[place - 1]) * 1e3
        notes.append(
            f"{recording.name}: no samples for {length:.3g} ms after {last:.4f} s; "
            "the recording is split there."
        )
    parts = [rows for rows in np.split(np.arange(len(time)), breaks)]
    parts = [rows for rows in parts if len(rows) >= 2 * max(bridge, 1)]
    found = []
    for number, rows in enumerate(parts, start=1):
        name = recording.name if len(parts) == 1 else f"{recording.name}_piece{number}"
        found.append(_even(recording, rows, name, interval))
    return found


def _even(recording: Recording, rows, name: str, interval: float) -> Recording:
    """Return one piece with the dropped samples replaced by cubic interpolation."""
    time = recording.time[rows]
    # round each interval separately, so that jitter of the samples does not accumulate
    ticks = np.maximum(np.round(np.diff(time) / interval).astype(int), 1)
    places = np.concatenate([[0], np.cumsum(ticks)])
    count = places[-1] + 1
    # the recording may have been mended before
    before = None if recording.filled is None else recording.filled[rows]
    if count == len(rows):
        channels = {c: v[rows] for c, v in recording.channels.items()}
        return dataclasses.replace(
            recording, name=name, time=time, channels=channels, filled=before
        )
    from scipy.interpolate import PchipInterpolator

    filled = np.ones(count, dtype=bool)
    filled[places] = False if before is None else before
    even = np.interp(np.arange(count), places, time)
    channels = {
        c: np.asarray(PchipInterpolator(time, v[rows])(even))
        for c, v in recording.channels.items()
    }
    for c, v in recording.channels.items():
        channels[c][places] = v[rows]
    return dataclasses.replace(
        recording, name=name, time=even, channels=channels, filled=filled
    )
