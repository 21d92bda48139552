"""Find the samples at which an impact is possible: minima of a gap near the surface."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import minimum_filter1d, uniform_filter1d


# Largest gap at an impact, in standard deviations of a sample
_NEAR = 8.0
# Fraction of the largest gap within which a missed impact is sought
_FAR = 0.25


def candidates(
    gaps: Float[np.ndarray, "g k"],
    noises: Float[np.ndarray, " g"],
    errors: Float[np.ndarray, " g"],
    apart: int,
) -> Int[np.ndarray, " m"]:
    """Return the samples at which an impact is possible: each is the lowest of those
    within `apart` samples.

    Between two samples, the motion may have been closer to the surface than at either
    of them, at most by the distance that it covers in a sampling interval.

    **Arguments:** the gaps at every sample, the noise and the largest constant error of
    each of them.
    """
    found = np.zeros(gaps.shape[1], dtype=bool)
    for gap, noise, error in zip(gaps, noises, errors, strict=True):
        step = np.abs(np.diff(gap))
        step = np.maximum(np.append(step, step[-1:]), np.append(step[:1], step))
        smooth = uniform_filter1d(gap, 2 * apart - 1)
        lowest = smooth == minimum_filter1d(smooth, 2 * apart + 1)
        found |= lowest & (gap < min(error, np.ptp(gap) / 2) + _NEAR * noise + step)
    found[:2] = found[-2:] = False
    return np.flatnonzero(found)


def near_a_surface(
    gaps: Float[np.ndarray, "g k"],
    noises: Float[np.ndarray, " g"],
    errors: Float[np.ndarray, " g"],
) -> Bool[np.ndarray, " k"]:
    """Return whether a missed impact is possible at each sample."""
    reach = np.maximum(_FAR * np.max(gaps, axis=1), errors + _NEAR * noises)
    return np.any(gaps < reach[:, None], axis=0)
