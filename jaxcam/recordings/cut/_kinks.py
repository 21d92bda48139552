"""Find impacts without a model, as upward velocity jumps of a smooth motion."""

import numpy as np
from jaxtyping import Float, Int
from scipy.signal import find_peaks


# Length (s) of the windows on either side of a kink in which it is detected
WINDOW = 0.01
# Smallest jump in slope of a kink, in standard errors
_THRESHOLD = 7.0


def find_kinks(
    samples: Float[np.ndarray, " k"],
    interval: float,
    noise: float,
    *,
    derivative: int = 1,
) -> Int[np.ndarray, " kinks"]:
    """Return the index of the first sample after each jump in velocity.

    Parabolas through the `WINDOW` before and after each sample are compared; a kink is
    a local maximum of the jump in slope that exceeds `_THRESHOLD` times its standard
    error.

    **Arguments:** `derivative`: 1 if the samples are positions; 0 if they are
    velocities, in which a jump separates straight lines.
    """
    score = _jump_score(samples, interval, noise, derivative)
    apart = max(1, int(WINDOW / interval / 2))
    return find_peaks(score, height=_THRESHOLD, distance=apart)[0]


def _jump_score(
    samples: Float[np.ndarray, " k"], interval: float, noise: float, derivative: int
) -> Float[np.ndarray, " k"]:
    """Return the jump in a derivative before each sample divided by its standard error,
    shape `(k,)`.
    """
    count = max(6, round(WINDOW / interval))
    score = np.zeros(len(samples))
    if len(samples) < 2 * count:
        return score
    # the boundary is assumed to lie half a sampling interval before the first sample
    # after it; times are measured from there
    offsets = (np.arange(count) + 0.5) * interval
    design = (offsets / offsets[-1])[:, None] ** np.arange(derivative + 2)
    weights = np.linalg.pinv(design)[derivative] / offsets[-1] ** derivative
    windows = np.lib.stride_tricks.sliding_window_view(samples, count)
    after = windows @ weights
    before = (-1) ** derivative * (windows @ weights[::-1])
    jump = after[count:] - before[:-count]
    error = noise * np.sqrt(2 * np.sum(weights**2))
    score[count : len(samples) - count + 1] = jump / error
    return score
