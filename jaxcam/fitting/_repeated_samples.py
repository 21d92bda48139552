"""Note samples that only repeat the one before, such as stale frames of a camera."""

import dataclasses
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from ..recordings import Recording


# Motion is fast where a channel changes over three samples by this many times its
# resolution: two equal successive samples are then no matter of rounding
_FAST = 8.0
# Changes below this fraction of the range of a channel are rounding
_ROUNDING = 1e-9
# Least number of samples in fast motion, and the fraction of them that may repeat the
# one before
_ENOUGH, _FEW = 30, 0.1


def repeats_noted(recording: Recording, channels: Iterable[str]) -> Recording:
    """Return a recording with a note on each channel that repeats many samples although
    the motion is fast.
    """
    notes = []
    for name in channels:
        share = _repeated(recording.channels[name])
        if share > _FEW:
            notes.append(
                f"{recording.name}: in fast motion, {share:.0%} of the samples of "
                f"`{name}` repeat the one before, as if the sensor or camera delivered "
                "new values less often than they were stored; delete the rows that "
                "repeat a sample, because they look like missing physics."
            )
    if not notes:
        return recording
    meta = {**recording.meta, "notes": (*recording.meta.get("notes", ()), *notes)}
    return dataclasses.replace(recording, meta=meta)


def _repeated(samples: Float[np.ndarray, " k"]) -> float:
    """Return the fraction of samples in fast motion that repeat the one before."""
    steps = np.abs(np.diff(samples))
    changes = steps[steps > 0]
    if len(steps) < _ENOUGH or not len(changes):
        return 0.0
    # the resolution, apart from changes that are only rounding of the numbers
    step = np.min(changes[changes > _ROUNDING * np.ptp(samples)], initial=np.inf)
    fast = np.abs(samples[3:] - samples[:-3]) > _FAST * step
    # a channel that mostly rests and jumps now and then is not in fast motion
    if np.sum(fast) < max(_ENOUGH, len(fast) / 4):
        return 0.0
    return float(np.mean(steps[1:-1][fast] == 0))
