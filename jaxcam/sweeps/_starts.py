"""Draw random initial states."""

import numpy as np


def monte_carlo(low, high, count: int, seed: int = 0, points: int | None = None):
    """Draw states uniformly from a box (thesis, eq. 3.26).

    Args:
        low: Lower corner of the box, shape `(n,)`.
        high: Upper corner of the box, shape `(n,)`.
        count: Number of states.
        seed: Seed of the random numbers.
        points: Number of parameter values, each with a separate set of states.

    Returns:
        The states, shape `(count, n)` or `(points, count, n)`. A larger number of
            `points` adds sets without changing the first ones.

    Raises:
        ValueError: The corners are inconsistent, or `count` is below one.

    Examples:
        >>> from jaxcam.sweeps import monte_carlo
        >>> monte_carlo([0.0, -1.0], [1.0, 1.0], 5).shape
        (5, 2)
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if low.shape != high.shape or low.ndim != 1 or not np.all(low <= high):
        raise ValueError(
            f"low is {low} and high is {high}; give the lower and upper corners of a "
            "box"
        )
    if count < 1:
        raise ValueError(f"count is {count}; give 1 or more states")
    draws = np.random.default_rng(seed).uniform(size=(points or 1, count, len(low)))
    states = low + (high - low) * draws
    return states if points is not None else states[0]
