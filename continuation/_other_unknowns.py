"""Problems whose unknowns can be replaced where they become singular."""

import abc
from typing import Any

import numpy as np

from .problem import AbstractProblem


class AbstractRestated(AbstractProblem):
    """A problem that represents a solution by other unknowns where necessary."""

    @abc.abstractmethod
    def restated(
        self, leaf: int, z: np.ndarray, before: np.ndarray | None
    ) -> tuple[AbstractProblem, np.ndarray, np.ndarray | None] | None:
        """Return the problem with other unknowns, if the present ones are about to
        become singular; otherwise None.

        Args:
            leaf: Index of the parameter among the leaves.
            z: The solution and the parameter, shape `(n + 1,)`.
            before: The solution before it on the branch, or None.

        Returns:
            The problem, the solution and the parameter, and the difference from the
                solution before it, or None.
        """

    @abc.abstractmethod
    def stored(self, observed: dict[str, Any], u: np.ndarray) -> dict[str, Any]:
        """Return the quantities to store, which must not depend on the unknowns that
        are used; the parameters are those of the problem.

        Args:
            observed: The quantities computed with the solution.
            u: The solution, shape `(n,)`.

        Returns:
            The quantities to store.
        """
