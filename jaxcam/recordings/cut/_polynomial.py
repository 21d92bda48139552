"""Polynomials through one side of a boundary, with the errors of what they say."""

import dataclasses
import math

import numpy as np
from jaxtyping import Float


@dataclasses.dataclass(frozen=True)
class LocalFit:
    """A polynomial in `time - origin` and the covariance of its coefficients."""

    origin: float
    coefficients: Float[np.ndarray, " p"]
    covariance: Float[np.ndarray, " p p"]

    def value(self, time: float) -> float:
        return float(self._row(time) @ self.coefficients)

    def values(self, times: Float[np.ndarray, " k"]) -> Float[np.ndarray, " k"]:
        """At many times at once."""
        return np.polynomial.polynomial.polyval(times - self.origin, self.coefficients)

    def slope(self, time: float) -> float:
        return float(self._slope_row(time) @ self.coefficients)

    def value_stderr(self, time: float) -> float:
        row = self._row(time)
        return float(np.sqrt(row @ self.covariance @ row))

    def slope_stderr(self, time: float) -> float:
        row = self._slope_row(time)
        return float(np.sqrt(row @ self.covariance @ row))

    def _row(self, time):
        return (time - self.origin) ** np.arange(len(self.coefficients))

    def _slope_row(self, time):
        powers = np.arange(1, len(self.coefficients))
        return np.concatenate([[0.0], powers * (time - self.origin) ** (powers - 1)])


def fit_local(
    time: Float[np.ndarray, " k"],
    samples: Float[np.ndarray, " k"],
    noise: float,
    origin: float,
) -> LocalFit:
    """Least squares, of the degree that so many samples can bear: one to three.

    **Arguments:**

    - `noise`: standard deviation of a sample, which sets the covariance.
    - `origin`: time at which the fit will be asked.
    """
    degree = 3 if len(time) >= 24 else 2 if len(time) >= 8 else 1
    degree = min(degree, len(time) - 1)
    # scaled to about one, or the normal matrix is near singular
    scale = max(float(np.max(np.abs(time - origin))), np.finfo(float).tiny)
    powers = np.arange(degree + 1)
    design = ((time - origin) / scale)[:, None] ** powers
    inverse = np.linalg.pinv(design)
    unscale = scale ** -powers.astype(float)
    covariance = noise**2 * (inverse @ inverse.T) * np.outer(unscale, unscale)
    return LocalFit(origin, (inverse @ samples) * unscale, covariance)


def crossing(
    before: LocalFit, after: LocalFit, time: float, reach: float
) -> tuple[float, float]:
    """Return where two fits meet, and the standard error of that time (s), by Newton.

    The search goes no further than `reach` (s) from `time`, where both were fitted.
    """
    earliest, latest = time - reach, time + reach
    for _ in range(5):
        jump = after.slope(time) - before.slope(time)
        if jump == 0:
            break
        time = time - (after.value(time) - before.value(time)) / jump
        time = min(max(time, earliest), latest)
    jump = after.slope(time) - before.slope(time)
    error = np.hypot(before.value_stderr(time), after.value_stderr(time))
    return float(time), float(error / abs(jump)) if jump else float("inf")


def measured_noise(samples: Float[np.ndarray, " k"], order: int = 3) -> float:
    """Standard deviation of white noise on a smooth signal, from its differences.

    The few differences that stand out, as those across an impact do, are left out.

    **Arguments:** the `order` of the differences, three by default.
    """
    if len(samples) < 2 * order + 2:
        return float("nan")
    each = np.diff(samples, order)
    spread = np.median(np.abs(each)) / 0.6745
    usual = each[np.abs(each) <= 5 * spread]
    # a difference of white noise has the sum of the squared binomials as its variance
    return float(np.sqrt(np.mean(usual**2) / math.comb(2 * order, order)))


def least_noise(samples: Float[np.ndarray, " k"]) -> float:
    """A lower bound of `measured_noise` that few samples per period do not raise.

    What differences of a low order show of the motion itself, those of a high order do
    not; white noise is the same in all of them.
    """
    return min(measured_noise(samples, order) for order in range(3, 9))
