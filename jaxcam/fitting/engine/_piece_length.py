"""Limit the pieces of a flight to half an oscillation of the measured motion."""

import numpy as np
from jaxtyping import Float


# Minimum number of samples in a piece; shorter pieces would hardly determine their own
# initial states
_SHORTEST = 12
# The residual of a cubic must be less than this fraction of that of a straight line;
# for a sine, this is the case for windows of up to about half its period
_PART = 0.05
# Residuals up to this multiple of the noise count as noise, regardless of curvature
_NOISE = 2.0
# Fraction of the windows of a flight that must pass this test
_MOST = 0.75


def bearable_length(
    samples: Float[np.ndarray, " k"], noise: float, longest: int
) -> int:
    """Return the number of samples in the longest pieces of a flight that cubics can
    fit.

    The initial state of a piece is estimated from a polynomial fitted to the piece. In
    addition, if a prediction covers more than half a period of an oscillation, the cost
    has several minima as a function of the frequency. The lengths tried are `longest`
    and shorter ones, decreasing by factors of about 0.7.

    **Arguments:** the `samples` of one flight, their `noise`, and the maximum number of
    samples in a piece (`longest`).
    """
    values = np.asarray(samples, dtype=float)
    values = values[np.isfinite(values)]
    length = longest
    while length > _SHORTEST and not _followed(values, noise, length):
        length = max(_SHORTEST, round(0.7 * length))
    return length


def _followed(values, noise: float, length: int) -> bool:
    """Return whether cubics fit most windows of this length."""
    length = min(length, len(values))
    if length < _SHORTEST:
        return True
    count = len(values) // length
    windows = values[: count * length].reshape(count, length)
    if len(values) % length:
        windows = np.concatenate([windows, values[None, -length:]])
    line, cubic = (_left_over(windows, degree) for degree in (1, 3))
    return bool(np.mean(cubic < np.maximum(_NOISE * noise, _PART * line)) >= _MOST)


def _left_over(windows, degree: int):
    """Return the rms residual of a polynomial fitted to each window, `(w,)`."""
    length = windows.shape[1]
    place = np.linspace(-1.0, 1.0, length)
    basis, _ = np.linalg.qr(place[:, None] ** np.arange(degree + 1))
    off = windows - (windows @ basis) @ basis.T
    return np.sqrt(np.sum(off**2, axis=1) / (length - degree - 1))
