"""Compute the score and information of all parameters at a fit, free or not."""

import dataclasses
from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

from ._fit_result import Fit
from .engine import (
    Columns,
    free_columns,
    invert_information,
    linearised,
    off_nominal,
    prior_information,
    Problem,
    reduced,
    Weights,
)


@dataclasses.dataclass(frozen=True)
class Linearised:
    """The likelihood about a fit as a quadratic function of all parameters.

    Each parameter is in units of its scale, and the states are eliminated.
    """

    problem: Problem
    """The problem."""
    names: tuple[str, ...]
    """Names of the parameters."""
    columns: Columns
    """The free values."""
    information: Float[np.ndarray, "g g"]
    """Information of the data alone, shape `(g, g)`."""
    score: Float[np.ndarray, " g"]
    """Score of data and prior, shape `(g,)`."""
    prior: Float[np.ndarray, " g"]
    """Diagonal of the prior's information, shape `(g,)`."""

    def gain(self, names: Iterable[str], beside: Iterable[str] = ()) -> float:
        """Return the gain in twice the log-likelihood if `names` were freed.

        The example continues the one in [`jaxcam.fitting.fit`][].

        Args:
            names: Names of the parameters to free.
            beside: Parameters that are free in any case and absorb part of the gain.

        Returns:
            The gain.

        Examples:
            >>> from jaxcam.fitting import linearise
            >>> held = fitting.fit(problem, free=())  # gravity at its nominal value
            >>> gain = linearise(problem, held).gain(["gravity"])
            >>> abs(gain - (held.cost - found.cost)) < 0.1
            True
        """
        names, beside = tuple(names), tuple(beside)
        with_, without = self._best((*names, *beside)), self._best(beside)
        return with_ - without

    def step(self, names: Iterable[str]) -> dict[str, tuple[float, float]]:
        """Return the change of each freed parameter, and its standard error.

        The result is exact for a quadratic likelihood. Parameters that differ from
        recording to recording are named `name@record`.
        """
        rows = self._rows(names)
        inverse = invert_information(self._block(rows))
        change = inverse @ self.score[rows] * self.columns.scale[rows]
        stderr = np.sqrt(np.abs(np.diag(inverse))) * self.columns.scale[rows]
        return {
            self.names[row]: (float(c), float(e))
            for row, c, e in zip(rows, change, stderr)
        }

    def _best(self, names) -> float:
        rows = self._rows(names)
        if not len(rows):
            return 0.0
        return float(
            self.score[rows] @ invert_information(self._block(rows)) @ self.score[rows]
        )

    def _block(self, rows):
        return self.information[np.ix_(rows, rows)] + np.diag(self.prior[rows])

    def _rows(self, names):
        wanted = set(names)
        for name in wanted:
            self.problem.parameter(name)
        plain = [self.problem.names[p] for p in self.columns.parameter]
        return np.array([k for k, n in enumerate(plain) if n in wanted], dtype=int)


def linearise(
    problem: Problem, found: Fit, *, weights: Weights | None = None, prior: bool = True
) -> Linearised:
    """Return the score and information of all parameters about a fit.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        problem: The problem.
        found: The fit.
        weights: As for [`jaxcam.fitting.fit`][].
        prior: As for [`jaxcam.fitting.fit`][].

    Returns:
        A `Linearised`.

    Examples:
        >>> from jaxcam.fitting import linearise
        >>> linearise(problem, found).names
        ('gravity',)
    """
    columns = free_columns(problem, None)
    extras = problem.weighted(weights)
    blocks, _ = linearised(problem, columns, extras, found.point)
    information, score = reduced(columns, blocks)
    strength = prior_information(problem, columns, prior)
    score = score - strength * off_nominal(problem, columns, found.point)
    names = columns.labels(problem)
    return Linearised(problem, names, columns, information, score, strength)
