"""Compute the joint confidence region of parameters from their covariance."""

import dataclasses
from collections.abc import Sequence

import numpy as np
import scipy.stats
from jaxtyping import Bool, Float


# Correlation below which knowing one parameter hardly helps to determine another
_WEAK = 0.3


@dataclasses.dataclass(frozen=True)
class Ellipse:
    """Joint confidence region of d parameters, an ellipse or an ellipsoid.

    It contains the points p with (p - centre)' C^-1 (p - centre) below the quantile of
    the chi-square distribution with d degrees of freedom, where C is the covariance of
    these parameters with all others free. The region is exact for a model that is
    linear over it; for a nonlinear model see [`jaxcam.fitting.excess_cost`][].
    """

    names: tuple[str, ...]
    """Names of the `d` parameters, in the order of all other fields."""
    centre: Float[np.ndarray, " d"]
    """Centre, in the units of the parameters, shape `(d,)`."""
    covariance: Float[np.ndarray, "d d"]
    """Covariance, in the units of the parameters, shape `(d, d)`."""
    level: float
    """Probability that the region contains the true values."""

    @property
    def limit(self) -> float:
        """Chi-square at the boundary of the region."""
        return float(scipy.stats.chi2.ppf(self.level, len(self.names)))

    @property
    def axes(self) -> Float[np.ndarray, "d d"]:
        """Semi-axes, one per row, from the centre to the boundary, the longest first.
        They are orthogonal when each parameter is expressed in units of its standard
        error, so the choice of units does not affect them.
        """
        return (self._roots() * np.sqrt(self.limit)).T

    def chi_square(self, points: Float[np.ndarray, "*k d"]) -> Float[np.ndarray, "*k"]:
        """Return the squared distance of points from the centre, in units of the
        standard errors.
        """
        off = (np.asarray(points, dtype=float) - self.centre) @ np.linalg.pinv(
            self._roots()
        ).T
        return np.asarray(np.sum(off**2, axis=-1))

    def contains(self, points: Float[np.ndarray, "*k d"]) -> Bool[np.ndarray, "*k"]:
        """Return whether points lie inside the region."""
        return np.asarray(self.chi_square(points) <= self.limit)

    def polygon(self, points: int = 181) -> Float[np.ndarray, "k 2"]:
        """Return the boundary of an ellipse as a closed line for plotting, shape
        `(points, 2)`.

        Raises:
            ValueError: There are more than two parameters.
        """
        if len(self.names) != 2:
            raise ValueError(
                f"An ellipsoid of {len(self.names)} parameters has no outline; request "
                f"the ellipse of two of them."
            )
        angle = np.linspace(0.0, 2 * np.pi, points)
        return self.centre + np.stack([np.cos(angle), np.sin(angle)], axis=1) @ (
            self.axes
        )

    def _roots(self) -> Float[np.ndarray, "d d"]:
        """Return columns whose outer products add up to the covariance."""
        size = np.sqrt(np.diag(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(size, size))
        return (size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))[:, ::-1]


def ellipse_of(
    names: Sequence[str], labels: Sequence[str], centre, covariance, level: float
) -> Ellipse:
    """Return the region of the parameters `names`, which must be among the labels."""
    if not 0 < level < 1:
        raise ValueError(f"The level is {level:g}; give a probability between 0 and 1.")
    if len(set(names)) != len(names) or len(names) < 2:
        raise ValueError(
            f"A joint region requires two or more different parameters, not "
            f"{', '.join(names) or 'none'}."
        )
    missing = [name for name in names if name not in labels]
    if missing:
        raise KeyError(
            f"{missing[0]!r} was not fitted; the fitted parameters are "
            f"{', '.join(labels)}"
        )
    rows = [list(labels).index(name) for name in names]
    part = np.asarray(covariance)[np.ix_(rows, rows)]
    if not np.all(np.isfinite(part) & (np.diag(part) > 0)[:, None]):
        raise ValueError(
            f"One of {', '.join(names)} has no finite error; fix the parameters that "
            "the data do not determine."
        )
    return Ellipse(tuple(names), np.asarray(centre, dtype=float)[rows], part, level)


def most_correlated(labels: Sequence[str], correlation) -> str:
    """Describe the most correlated pair of parameters in a sentence."""
    if len(labels) < 2:
        return "Fewer than two parameters were fitted, so none are correlated."
    size = np.abs(np.where(np.isfinite(correlation), correlation, 0.0))
    size = np.tril(size, -1)
    if not np.any(size):
        return "No two fitted parameters are correlated."
    i, k = divmod(int(np.argmax(size)), len(labels))
    value = float(np.clip(correlation[i, k], -1.0, 1.0))
    if abs(value) < _WEAK:
        return (
            "The errors of the fitted parameters depend little on each other: the "
            f"strongest correlation, between {labels[k]} and {labels[i]}, is "
            f"{value:+.4f}."
        )
    kept = max(1 - value**2, np.finfo(float).eps) ** 0.5
    together = "in opposite directions" if value < 0 else "together"
    return (
        f"{labels[k]} and {labels[i]} are the hardest to distinguish: their errors "
        f"vary {together} "
        f"(correlation {value:+.4f}), and if one were known, the error of the other "
        f"would be {kept:.2g} times its present value."
    )
