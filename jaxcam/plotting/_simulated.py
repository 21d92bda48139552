"""Obtain the simulated values at the samples of a recording."""

import numpy as np
from jaxtyping import Float

from ..recordings import Recording
from ..recordings.against_model import Comparison


def simulated_channel(
    comparison: Comparison, recording: Recording, channel: str
) -> Float[np.ndarray, " k"]:
    """Return the simulated channel at the samples of the recording; NaN elsewhere.

    A comparison contains the differences in flight and in contact, each at its sample.

    **Raises:** `ValueError` if the recording is not in the comparison.
    """
    parts = [
        part
        for part in comparison.residuals
        if part.record == recording.name
        and part.channel == channel
        and part.mode in ("flight", "contact")
    ]
    if not parts:
        there = sorted({f"{p.channel} of {p.record}" for p in comparison.residuals})
        raise ValueError(
            f"The comparison has no {channel} of {recording.name}; it has "
            f"{', '.join(there) or 'nothing'}."
        )
    simulated = np.full(len(recording), np.nan)
    for part in parts:
        rows = np.searchsorted(recording.time, part.time)
        simulated[rows] = recording[channel][rows] - part.value
    return simulated
