"""Let problems with different numbers of unknowns share one compiled program."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float


class Padded(NamedTuple):
    """A problem with additional unknowns, each fixed at zero by an equation u = 0.

    Examples:
        >>> import continuation
        >>> padded = continuation.Padded(None, kept=np.arange(2), size=4)
        >>> padded.widened(np.array([1.0, 2.0, 0.5])).tolist()
        [1.0, 2.0, 0.0, 0.0, 0.5]
    """

    problem: Any
    """The problem with the additional unknowns."""
    kept: np.ndarray
    """Position of each original unknown among all unknowns, shape `(n,)`."""
    size: int
    """Number of unknowns including the additional ones."""
    lengths: Mapping[str, int] = MappingProxyType({})
    """Number of rows of observed quantities that are not padding, by name."""

    def positions(self, count: int) -> np.ndarray:
        """Return the positions of the original unknowns and of the entries after them.

        Args:
            count: Number of entries of a vector without the additional unknowns.

        Returns:
            Positions, shape `(count,)`.
        """
        behind = count - self.kept.size
        return np.append(self.kept, self.size + np.arange(behind))

    def widened(self, z: Float[np.ndarray, " k"]) -> Float[np.ndarray, " wide"]:
        """Return a vector with zeros for the additional unknowns.

        Args:
            z: The n unknowns and further entries, such as a parameter, which remain at
                the end.

        Returns:
            The longer vector.
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
