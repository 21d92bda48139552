"""Let problems with different numbers of unknowns share one compiled program."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float


class Padded(NamedTuple):
    """A problem with additional unknowns, whose equations are u = 0."""

    problem: Any
    """The problem with the additional unknowns."""
    kept: np.ndarray
    """Position of each original unknown among them, shape `(n,)`."""
    size: int
    """Number of unknowns including the additional ones."""
    lengths: dict[str, int] = {}
    """Number of rows of observed quantities that are not padding, by name."""

    def positions(self, count: int) -> np.ndarray:
        """Return the positions of the original unknowns and of those behind all, for a
        vector of `count` entries.
        """
        behind = count - self.kept.size
        return np.append(self.kept, self.size + np.arange(behind))

    def widened(self, z: Float[np.ndarray, " k"]) -> Float[np.ndarray, " wide"]:
        """Return a vector with zeros for the additional unknowns.

        Entries beyond the n unknowns, such as a parameter, remain at the end.
        """
        wide = np.zeros(self.size + len(z) - self.kept.size)
        wide[self.positions(len(z))] = z
        return wide


def as_compiled(problem: Any, u) -> tuple[Any, Any]:
    """Return the problem that compiled programs use for this one, and its unknowns."""
    padded = problem.padded()
    if padded is None:
        return problem, u
    return padded.problem, padded.widened(np.asarray(u))
