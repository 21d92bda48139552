"""The period of the oscillation in a motion, and whether jumps can be seen in it."""

import numpy as np
from jaxtyping import Float

from ._kinks import WINDOW
from ._polynomial import least_noise


# Kinks are detected reliably if the period of the motion is at least this many windows
_WINDOWS = 5.0
# Number of samples of the shortest window
_SHORTEST = 6


def oscillation_period(samples: Float[np.ndarray, " k"], interval: float) -> float:
    """Return the period of the oscillation in a motion (s): that of a sine with the
    same ratio of rms velocity to rms deviation; infinite for a motion at rest.
    """
    noise = least_noise(samples)
    size = float(np.var(samples)) - noise**2
    steps = float(np.mean(np.diff(samples) ** 2)) - 2 * noise**2
    if not (steps > 0 and size > 0):
        return float("inf")
    # the step of a sine over a sampling interval is twice the sine of half its angle
    half = min(1.0, np.sqrt(steps / size) / 2)
    return float(np.pi * interval / np.arcsin(half))


def hides_kinks(period: float, interval: float) -> bool:
    """Return whether an oscillation bends so much within the windows in which kinks are
    detected that it cannot be distinguished from a kink.
    """
    return period < _WINDOWS * max(WINDOW, _SHORTEST * interval)
