"""Representations of the same solution."""

import abc

import equinox as eqx
import numpy as np
from jaxtyping import Float, PyTree


class AbstractRepresentation(eqx.Module):
    """Representations of the solutions of a problem, used to detect equal solutions.

    For example, a periodic orbit can start at any of several points, and its phases can
    be measured from the start of any period. The methods are called between compiled
    programs, with NumPy arrays.
    """

    family: eqx.AbstractVar[str]
    """Name of the family. Two problems belong to the same family if they have the same
    solutions, described by the same unknowns.
    """

    @abc.abstractmethod
    def copies(
        self, u: np.ndarray, tangent: np.ndarray
    ) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """Return all representations of this solution, starting with the unchanged one.

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            tangent: Tangent of the branch, `(n,)`.

        Returns:
            The family, state `(n,)` and tangent `(n,)` of each representation. A branch
                that meets one of the representations again is closed.
        """

    @abc.abstractmethod
    def brought_near(
        self, states: Float[np.ndarray, "k n"], u: np.ndarray
    ) -> Float[np.ndarray, "k n"]:
        """Return the same solutions, with phases shifted by whole periods and angles by
        whole turns to be as close as possible to `u`.

        Args:
            states: Solutions, `(k, n)`.
            u: Unknowns of the equations, shape `(u,)`.

        Returns:
            Solutions, shape `(k, n)`.
        """

    @abc.abstractmethod
    def half_away(self, u: np.ndarray, parameters: PyTree) -> float | None:
        """Return the distance of a periodic orbit from an orbit of half its period.

        Args:
            u: Unknowns of the equations, shape `(u,)`.
            parameters: Parameters of the problem.

        Returns:
            The distance, measured like the length of a step; None if the problem has no
                orbits of half the period.
        """


class Unique(AbstractRepresentation):
    """The representation for problems in which each solution has only one form."""

    family: str = eqx.field(static=True)

    def copies(self, u, tangent):
        return [(self.family, u, tangent)]

    def brought_near(self, states, u):
        del u
        return states

    def half_away(self, u, parameters):
        del u, parameters
        return None
