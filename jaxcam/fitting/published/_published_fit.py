"""The result of a fit to published values, and its undetermined combinations."""

import dataclasses
from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

import numpy as np
from jaxtyping import Bool, Float

from .._ellipse import Ellipse, ellipse_of, most_correlated


if TYPE_CHECKING:
    import pandas as pd


@dataclasses.dataclass(frozen=True)
class PublishedFit:
    """Result of [`jaxcam.fitting.fit_published`][].

    - `estimates`, `stderr`, `covariance`: shapes `(p,)`, `(p,)`, `(p, p)`; they
        include the priors and use the stated errors of the data.
    - `chi_square`: chi-square of the data alone.
    """

    model: Any
    """The model with the estimates in it."""
    names: tuple[str, ...]
    """Names of the parameters."""
    nominal: Float[np.ndarray, " p"]
    """Nominal values, shape `(p,)`."""
    tolerances: Float[np.ndarray, " p"]
    """Tolerances, shape `(p,)`."""
    estimates: Float[np.ndarray, " p"]
    """Estimates, including the priors, shape `(p,)`."""
    covariance: Float[np.ndarray, "p p"]
    """Covariance of the estimates, shape `(p, p)`."""
    shares: Float[np.ndarray, " p"]
    """Share of the information on each combination of parameters that comes from the
    data rather than the priors (0 to 1), ascending, shape `(p,)`.
    """
    directions: Float[np.ndarray, "p p"]
    """The combinations, one per row, in units of the tolerances, shape `(p, p)`."""
    published: tuple[Any, ...]
    """The published values."""
    predicted: Float[np.ndarray, " n"]
    """The computed values, shape `(n,)`."""
    steps: int
    """Number of iterations."""
    converged: bool
    """Whether the last stage of the fit met its tolerance."""

    @staticmethod
    def build(
        *,
        jacobian,
        tolerances,
        model,
        names,
        nominal,
        estimates,
        published,
        predicted,
        steps,
        converged,
    ) -> "PublishedFit":
        """Return the result, given the Jacobian of the data (in standard errors) with
        respect to the parameters.
        """
        finite: Bool[np.ndarray, " p"] = np.isfinite(tolerances)
        units = np.where(finite, tolerances, np.where(nominal == 0, 1, np.abs(nominal)))
        scaled = jacobian * units
        information = scaled.T @ scaled
        # a parameter without a prior has no prior information
        prior = np.diag(finite.astype(float))
        inverse = np.linalg.pinv(information + prior, hermitian=True)
        eigenvalues, vectors = np.linalg.eigh(information)
        eigenvalues = np.maximum(eigenvalues, 0.0)
        held = np.einsum("ij,ik,kj->j", vectors, prior, vectors)
        total = np.where(eigenvalues + held > 0, eigenvalues + held, 1.0)
        return PublishedFit(
            model=model,
            names=names,
            nominal=nominal,
            tolerances=tolerances,
            estimates=estimates,
            covariance=inverse * np.outer(units, units),
            shares=eigenvalues / total,
            directions=vectors.T,
            published=published,
            predicted=predicted,
            steps=steps,
            converged=converged,
        )

    @property
    def stderr(self) -> Float[np.ndarray, " p"]:
        """Standard error of each estimate, shape `(p,)`."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Float[np.ndarray, "p p"]:
        """Correlation matrix of the estimates, shape `(p, p)`."""
        errors = self.stderr
        return self.covariance / np.outer(errors, errors)

    def ellipse(self, names: Sequence[str], level: float = 0.95) -> Ellipse:
        """Return the joint confidence region of two or more parameters, with all others
        free.

        Raises:
            ValueError: As for [`jaxcam.fitting.Fit`][].
        """
        return ellipse_of(names, self.names, self.estimates, self.covariance, level)

    def most_correlated(self) -> str:
        """Return a sentence about the most correlated pair of parameters."""
        return most_correlated(self.names, self.correlation)

    @property
    def chi_square(self) -> float:
        """Sum of squared misfits, in standard errors."""
        return float(np.sum(self._misses() ** 2))

    def parameters(self) -> "pd.DataFrame":
        """Return nominal value, tolerance, estimate and standard error of each
        parameter.
        """
        import pandas as pd

        return pd.DataFrame(
            {
                "parameter": self.names,
                "nominal": self.nominal,
                "tolerance": self.tolerances,
                "estimate": self.estimates,
                "standard error": self.stderr,
            }
        )

    def numbers(self) -> "pd.DataFrame":
        """Return published and computed values, and their differences in standard
        errors.
        """
        import pandas as pd

        return pd.DataFrame(
            {
                "quantity": [
                    p.name if p.values.size == 1 else f"{p.name} [{k}]"
                    for p in self.published
                    for k in range(p.values.size)
                ],
                "printed": np.concatenate([p.values for p in self.published]),
                "computed": self.predicted,
                "miss": self._misses(),
            }
        )

    def weak(self, share: float = 0.5) -> list[str]:
        """Return a sentence on each poorly determined combination of parameters.

        These are the combinations for which the data provide less than the fraction
        `share` of the information; the priors provide the rest. The weakest
        combination is described first.
        """
        sentences = []
        for part, direction in zip(self.shares, self.directions, strict=True):
            if part >= share:
                continue
            order = np.argsort(-np.abs(direction))
            main = [k for k in order if abs(direction[k]) > 0.2]
            sign = np.sign(direction[main[0]])
            words = ", ".join(
                f"{sign * direction[k]:+.2f} {self.names[k]}" for k in main
            )
            sentences.append(
                f"The data provide {100 * part:.2g} % of the information on the "
                f"combination {words} (in units of the tolerances)."
            )
        return sentences

    def _misses(self):
        values = np.concatenate([p.values for p in self.published])
        errors = np.concatenate([p.errors for p in self.published])
        return (self.predicted - values) / errors
