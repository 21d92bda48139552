"""Estimate the angular acceleration of a drive from its encoder."""

import dataclasses
import itertools
import math

import numpy as np
from jaxtyping import Float
from scipy.signal import savgol_coeffs, savgol_filter


# Lengths of the cubics, relative to those of the parabolas that smooth the angle
_LENGTHS = (20, 10, 5, 2.5)
# Ratio of the mean square difference between the results for two lengths to that
# expected from noise alone; below this ratio, the longer cubics are kept
_SAME = 2.0


@dataclasses.dataclass(frozen=True)
class DriveAcceleration:
    """The angular acceleration of a drive (rad/s^2)."""

    values: Float[np.ndarray, " k"]
    """Acceleration at each sample."""
    stderr: float
    """Standard error of the acceleration, due to the noise and to the smoothing."""
    length: float
    """Length (s) of the cubics; the error of `values` hardly changes over shorter
    times.
    """


def drive_acceleration(
    angle: Float[np.ndarray, " k"], window: int, interval: float, noise: float
) -> DriveAcceleration:
    """Estimate the acceleration by local cubics.

    Shorter cubics are chosen as long as their result differs from that of longer ones
    by more than the noise explains.

    Args:
        angle: Samples of the angle of the drive (rad).
        window: Number of samples in each parabola that smooths the angle.
        interval: Sampling interval (s).
        noise: Standard deviation of the samples (rad).

    Returns:
        The acceleration, zero if the recording is too short to estimate it.
    """
    counts = [int(length * window) // 2 * 2 + 1 for length in _LENGTHS]
    counts = [count for count in counts if 5 <= count <= len(angle) // 3]
    if not counts:
        return DriveAcceleration(np.zeros(len(angle)), 0.0, 0.0)
    values = [
        np.asarray(savgol_filter(angle, n, 3, deriv=2, delta=interval)) for n in counts
    ]
    kernels = [savgol_coeffs(n, 3, deriv=2, delta=interval) for n in counts]
    inside = slice(counts[0] // 2, -(counts[0] // 2))
    chosen, bias = 0, 0.0
    for wide, narrow in itertools.pairwise(range(len(counts))):
        pad = (len(kernels[wide]) - len(kernels[narrow])) // 2
        apart = kernels[wide] - np.pad(kernels[narrow], pad)
        random = noise**2 * float(np.sum(apart**2))
        square = float(np.mean((values[wide] - values[narrow])[inside] ** 2))
        # the error due to smoothing is proportional to the square of the length
        ratio = (counts[narrow] / counts[wide]) ** 2
        bias = max(0.0, square - random) / (1 - ratio) ** 2
        if square < _SAME * random:
            break
        chosen, bias = narrow, bias * ratio**2
    # near the ends of a recording, the second derivative of a cubic is evaluated not in
    # its middle (u = 0) but closer to its end (u = 1); its variance is then 1 + 35 u^2
    # times, and its error due to the fourth derivative 1 - 7 u^2 times, the value in
    # the middle
    share = counts[chosen] / len(angle)
    own = (1 + 35 / 3 * share) * noise**2 * float(np.sum(kernels[chosen] ** 2))
    bias *= 1 + 77 / 15 * share
    length = counts[chosen] * interval
    return DriveAcceleration(values[chosen], math.sqrt(own + bias), length)
