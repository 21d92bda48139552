"""Block-wise Bayesian bootstrap: the scatter of estimates under random weights."""

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from ._fit import fit
from ._fit_result import Fit
from .engine import Weights


@dataclasses.dataclass(frozen=True)
class Bootstrap:
    """Estimates from a Bayesian bootstrap, in the same order as in the fit.

    Unlike the standard errors from the Fisher information, the scatter of these
    estimates reflects the actual residuals: if the model has a discrepancy, the scatter
    is larger than the noise explains. The example continues the one in
    [`jaxcam.fitting.fit`][].

    Examples:
        >>> from jaxcam.fitting import bootstrap
        >>> bootstrap(found, 3).stderr.shape
        (1,)
    """

    found: Fit
    """The fit."""
    estimates: Float[np.ndarray, "b g"]
    """Estimates, shape `(repetitions, g)`."""

    @property
    def stderr(self) -> Float[np.ndarray, " g"]:
        """Standard deviations of the estimates."""
        return np.std(self.estimates, axis=0, ddof=1)

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Return the percentile interval of a parameter."""
        names = [one.name for one in self.found.estimates]
        column = self.estimates[:, names.index(self.found[name].name)]
        low, high = np.quantile(column, [(1 - level) / 2, (1 + level) / 2])
        return float(low), float(high)


def bootstrap(
    found: Fit,
    repetitions: int = 50,
    *,
    seed: int = 0,
    prior: bool = True,
    iterations: int = 8,
    progress: Callable[[int, int], None] | None = None,
) -> Bootstrap:
    """Repeat a fit with random weights for the flights and contacts (Bayesian bootstrap
    over blocks; Rubin, 1981).

    A block is one flight with all its pieces, or one contact, because residuals are
    correlated within a flight or contact. The weights are exponentially distributed
    with mean 1. Drawing blocks with replacement would give weights with the same mean
    and variance, but would omit some blocks and the impacts at both of their ends. Each
    repetition starts at the optimum and needs few iterations. The example continues the
    one in [`jaxcam.fitting.fit`][].

    Args:
        found: The fit.
        repetitions: Number of repetitions.
        seed: Seed of the random weights.
        prior: Whether tolerances count as prior knowledge; use the same value as for
            `found`.
        iterations: Maximum number of iterations in each repetition.
        progress: Called with the number of completed repetitions and the total number.

    Returns:
        A [`jaxcam.fitting.Bootstrap`][].

    Examples:
        >>> from jaxcam.fitting import bootstrap
        >>> bootstrap(found, 3).estimates.shape
        (3, 1)
    """
    problem, rng = found.problem, np.random.default_rng(seed)
    blocks = []
    for record, (flown, rested) in enumerate(problem.spans):
        blocks += sorted({(record, 0, span.flight) for span in flown})
        blocks += sorted({(record, 1, span.flight) for span in rested})
    estimates = []
    for number in range(repetitions):
        weights = _weights(
            problem, dict(zip(blocks, rng.exponential(size=len(blocks))))
        )
        again = fit(
            problem,
            free=found.free,
            start=found,
            weights=weights,
            prior=prior,
            iterations=iterations,
        )
        estimates.append([one.value for one in again.estimates])
        if progress is not None:
            progress(number + 1, repetitions)
    return Bootstrap(found, np.array(estimates))


def _weights(problem, drawn) -> Weights:
    every = problem.everything()
    flown, rested = np.array(every.flown), np.array(every.rested)
    for record, sides in enumerate(problem.spans):
        for side, (spans, array) in enumerate(zip(sides, (flown, rested))):
            for k, span in enumerate(spans):
                array[record, k] = drawn[record, side, span.flight]
    return Weights(flown, rested)
