"""Block bootstrap: how the estimates scatter when flights count more or less."""

import dataclasses
from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from ._fit import fit
from ._fit_result import Fit
from .engine import Weights


@dataclasses.dataclass(frozen=True)
class Bootstrap:
    """Estimates from reweighted data, shape `(repetitions, g)`, in the fit's order.

    Unlike the Fisher information they count what is left over in the data as it is: a
    model that lacks something scatters more than the noise explains.
    """

    found: Fit
    estimates: Float[np.ndarray, "b g"]

    @property
    def stderr(self) -> Float[np.ndarray, " g"]:
        """Standard deviations of the estimates."""
        return np.std(self.estimates, axis=0, ddof=1)

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Interval between the outer percentiles of a parameter."""
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
    """Fit again with random weights on flights and contacts (Rubin, 1981).

    A block is one flight, all its pieces together, or one contact: what is left over in
    one part of a motion tends to be alike throughout. Weights are exponential with mean
    one; drawing blocks with replacement has the same mean and variance, but leaves
    out blocks altogether, and with them the impacts at both their ends. Each repetition
    starts at the optimum and needs few iterations.

    **Arguments:** number of repetitions, and of iterations at most in each; `prior` as
    it was for `found`.
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
