"""Initial states at random."""

import numpy as np


def monte_carlo(low, high, count: int, seed: int = 0, points: int | None = None):
    """States drawn evenly from a box. (3.26)

    Args:
        low: Corners of the box, shape `(n,)`.
        high: Corners of the box, shape `(n,)`.
        count: How many.
        points: With it, others for each of so many values of a parameter.

    Returns:
        Shape `(count, n)`, or `(points, count, n)`. Those of the first values do not
            depend on how many follow.

    Raises:
        ValueError: For corners that do not fit, or no states.
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    if low.shape != high.shape or low.ndim != 1 or not np.all(low <= high):
        raise ValueError(
            f"low is {low} and high {high}; give the corners of a box, low first"
        )
    if count < 1:
        raise ValueError(f"count is {count}; give 1 or more states")
    draws = np.random.default_rng(seed).uniform(size=(points or 1, count, len(low)))
    states = low + (high - low) * draws
    return states if points is not None else states[0]
