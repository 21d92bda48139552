"""Tell a slow transient from a motion without a period."""

import numpy as np
from jaxtyping import Bool, Float


# Number of parts of the samples, over which the distances between points must shrink;
# each part by at least this factor
_PARTS, _SHRINKS = 4, 0.9
# Distances of the last part, relative to the size of the motion, above which it may be
# chaotic
_CLOSE = 1e-2


def drifting(
    states: Float[np.ndarray, "motions keep n"],
) -> Bool[np.ndarray, " motions"]:
    """Return whether the points of each motion still approach a periodic orbit.

    The distances between points that are some periods apart then shrink throughout the
    samples, whereas on a chaotic or quasiperiodic motion they vary.

    Args:
        states: Samples, shape `(motions, keep, n)`.

    Returns:
        One value for each motion, shape `(motions,)`.
    """
    states = np.asarray(states, dtype=float)
    lanes, keep, _ = states.shape
    sizes = np.maximum(np.abs(states).max(axis=1, keepdims=True), 1e-300)
    found = np.zeros(lanes, dtype=bool)
    for n in range(1, keep // _PARTS + 1):
        apart = (np.abs(states[:, n:] - states[:, :-n]) / sizes).max(axis=2)
        if apart.shape[1] < _PARTS:
            break
        parts = np.array_split(apart, _PARTS, axis=1)
        most = np.stack([part.max(axis=1) for part in parts], axis=1)
        shrinks = np.all(most[:, 1:] < _SHRINKS * most[:, :-1], axis=1)
        found |= shrinks & (most[:, -1] < _CLOSE)
    return found
