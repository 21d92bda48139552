"""State that a recording has too few samples for its impacts to be found."""

import dataclasses
import math
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from ...recordings import Recording
from ...recordings.cut import oscillation_period


# Number of samples per oscillation below which impacts are not found reliably, and the
# number that is recommended
_FEW, _ENOUGH = 15, 30


def shortest_period(gaps: Iterable[Float[np.ndarray, " k"]], interval: float) -> float:
    """Return the shortest period of the oscillations of the gaps (s)."""
    return min((oscillation_period(gap, interval) for gap in gaps), default=math.inf)


def with_coarse_note(recording: Recording, period: float) -> Recording:
    """Return the recording with a note if it is too coarse.

    **Arguments:** the shortest `period` of its oscillations (s).
    """
    rate = 1 / recording.interval
    if period * rate >= _FEW:
        return recording
    needed = float(f"{_ENOUGH / period:.1e}")
    note = (
        f"{recording.name}: there are only {period * rate:.0f} samples per oscillation "
        f"({1 / period:.3g} Hz, sampled at {rate:.4g} Hz), so impacts may be missed or "
        f"misplaced; record at {needed:.4g} Hz or more."
    )
    notes = (*recording.meta.get("notes", ()), note)
    return dataclasses.replace(recording, meta={**recording.meta, "notes": notes})
