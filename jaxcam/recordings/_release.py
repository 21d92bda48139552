"""When the follower left the surface: slowly, so a threshold is always late."""

import numpy as np
from jaxtyping import Float


def release_time(
    time: Float[np.ndarray, " k"], gap: Float[np.ndarray, " k"], noise: float
) -> tuple[float, float]:
    """Time of release and its standard error (s), from the gap around it.

    At release the gap, its rate and its acceleration vanish together, so it opens as a
    cubic. A constant and that cubic are fitted for each possible time; the best one
    wins, and its error is where the sum of squares has grown by the noise.

    **Arguments:**

    - `time`, `gap`: samples from a little before release to well after it.
    - `noise`: standard deviation of a sample.
    """
    tried = np.linspace(time[0], time[-3], 4 * len(time))
    opened = np.maximum(0.0, time[None, :] - tried[:, None]) ** 3
    # linear regression of the gap on the cubic, for all times at once
    centred = opened - opened.mean(1, keepdims=True)
    level = gap - gap.mean()
    overlap = centred @ level
    size = np.maximum(np.sum(centred**2, axis=1), np.finfo(float).tiny)
    # a gap does not open downwards
    explained = np.where(overlap > 0, overlap**2 / size, 0.0)
    misfit = (np.sum(level**2) - explained) / noise**2
    best = int(np.argmin(misfit))
    likely = tried[misfit < misfit[best] + 1.0]
    return float(tried[best]), float(max(np.ptp(likely) / 2, tried[1] - tried[0]))
