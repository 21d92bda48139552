"""Refuse a recording whose motion is on the wrong side of its surfaces."""

from collections.abc import Sequence

import numpy as np

from .._errors import RecordingError
from ._motion import Motion


# A gap below zero by more than this many times the noise, by more than this fraction of
# the largest gap, and by more than the tolerance, is inside the constraint
_DEEP_NOISE, _DEEP_GAP = 20.0, 0.25
# Largest fraction of the samples that may be inside a constraint
_MOST = 0.5


def refuse_inside(
    name: str,
    sides: Sequence[Motion],
    tolerances: Sequence[float],
    names: Sequence[str] = (),
) -> None:
    """Raise `RecordingError` if the motion is inside a constraint most of the time.

    **Arguments:** the `name` of the recording, the motion relative to each surface, the
    largest errors of the gaps, and their names, by default their numbers.
    """
    deep = np.stack(
        [
            side.gap
            < -max(
                tolerance,
                _DEEP_NOISE * side.noise,
                _DEEP_GAP * float(np.max(side.gap)),
            )
            for side, tolerance in zip(sides, tolerances, strict=True)
        ]
    )
    share = float(np.mean(np.any(deep, axis=0)))
    if share <= _MOST:
        return
    inside = np.flatnonzero(np.any(deep, axis=1))
    found = [names[int(k)] if names else f"gap {k + 1}" for k in inside]
    raise RecordingError(
        f"{name}: the motion is inside the constraint ({' and '.join(found)} "
        f"below zero) for {share:.0%} of the recording; check the positions of the "
        "walls in the rig file, and the order, the signs and the units of the columns."
    )
