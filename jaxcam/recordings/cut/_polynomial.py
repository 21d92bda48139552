"""Fit polynomials to one side of a boundary, with their errors."""

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
        """Return the values of the polynomial at many times."""
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
    degree: int | None = None,
) -> LocalFit:
    """Fit a polynomial by least squares.

    **Arguments:**

    - `noise`: standard deviation of a sample, which determines the covariance.
    - `origin`: time at which the fit will be evaluated.
    - `degree`: the degree; by default `usual_degree`.
    """
    degree = usual_degree(len(time)) if degree is None else degree
    degree = min(degree, len(time) - 1)
    # times are scaled to about 1, because otherwise the normal matrix is nearly
    # singular
    scale = max(float(np.max(np.abs(time - origin))), np.finfo(float).tiny)
    powers = np.arange(degree + 1)
    design = ((time - origin) / scale)[:, None] ** powers
    inverse = np.linalg.pinv(design)
    unscale = scale ** -powers.astype(float)
    covariance = noise**2 * (inverse @ inverse.T) * np.outer(unscale, unscale)
    return LocalFit(origin, (inverse @ samples) * unscale, covariance)


def usual_degree(count: int) -> int:
    """Return the degree of a polynomial through a number of samples, one to three."""
    return 3 if count >= 24 else 2 if count >= 8 else 1


def crossing(
    before: LocalFit, after: LocalFit, time: float, reach: float
) -> tuple[float, float]:
    """Return the time at which two fits meet, found by Newton's method, and its
    standard error (s).

    The search extends to `reach` (s) on either side of `time`, near which both were
    fitted.
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
    """Estimate the standard deviation of white noise on a smooth signal from
    differences.

    Outlying differences, such as those across an impact, are omitted.

    **Arguments:** the `order` of the differences, three by default.
    """
    if len(samples) < 2 * order + 2:
        return float("nan")
    each = np.diff(samples, order)
    spread = np.median(np.abs(each)) / 0.6745
    usual = each[np.abs(each) <= 5 * spread]
    # the variance of a difference of white noise is that of the noise times the sum of
    # the squared binomial coefficients
    return float(np.sqrt(np.mean(usual**2) / math.comb(2 * order, order)))


def least_noise(samples: Float[np.ndarray, " k"]) -> float:
    """Return the smallest `measured_noise` over several orders of the differences, for
    motions with few samples per period.

    Low-order differences contain the motion itself, high-order ones do not; white noise
    contributes equally to all of them.
    """
    return min(measured_noise(samples, order) for order in range(3, 9))
