"""Locate the release, which is so gradual that a threshold would always detect it too
late.
"""

import numpy as np
from jaxtyping import Float


def release_time(
    time: Float[np.ndarray, " k"],
    gap: Float[np.ndarray, " k"],
    contact: Float[np.ndarray, " k"],
    rate: Float[np.ndarray, " k"],
    noise: float,
) -> tuple[float, float]:
    """Return the time of release and its standard error (s), from the gap around it.

    At release, the free body has the position, velocity and acceleration of the
    surface. It continues on the parabola defined by these values while the surface
    curves away, so the gap opens as a cubic whose coefficient follows from the surface.
    Each sample is tried as the release, and the one with the smallest sum of squares is
    used; the error is the distance at which the sum has increased by the noise
    variance.

    **Arguments:**

    - `time`, `gap`: samples from shortly before release to well after it.
    - `contact`, `rate`: position and velocity of the surface at those times.
    - `noise`: standard deviation of a sample.
    """
    acceleration = np.gradient(rate, time)
    past = time[None, :] - time[:, None]
    free = (
        contact[:, None]
        + rate[:, None] * past
        + acceleration[:, None] * past**2 / 2
        - contact[None, :]
    )
    misfit = gap[None, :] - np.where(past > 0, free, 0.0)
    # subtract the mean, because the surface may have a constant error
    misfit = misfit - misfit.mean(1, keepdims=True)
    squares = np.sum(misfit**2, axis=1)[:-2] / noise**2
    best = int(np.argmin(squares))
    likely = time[:-2][squares < squares[best] + 1.0]
    return float(time[best]), float(max(np.ptp(likely) / 2, time[1] - time[0]))
