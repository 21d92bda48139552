"""The ways in which one solution can be written down."""

import abc

import equinox as eqx
import numpy as np
from jaxtyping import Float, PyTree


class AbstractRepresentation(eqx.Module):
    """How the solutions of a problem are told apart, and which are the same.

    A periodic orbit can begin at several of its points, and phases count from any whole
    turn. Called between compiled programs, with NumPy arrays.
    """

    family: eqx.AbstractVar[str]
    """Problems of one family have the same solutions, as states of one form."""

    @abc.abstractmethod
    def copies(
        self, u: np.ndarray, tangent: np.ndarray
    ) -> list[tuple[str, np.ndarray, np.ndarray]]:
        """All ways to write this solution down, the first of them as it is.

        Returns:
            Family, state and tangent of each, both (n,). A branch that meets any of
                them again is closed.
        """

    @abc.abstractmethod
    def brought_near(
        self, states: Float[np.ndarray, "k n"], u: np.ndarray
    ) -> Float[np.ndarray, "k n"]:
        """The same solutions, as near `u` as can be: phases and angles may differ by
        whole turns."""

    @abc.abstractmethod
    def half_away(self, u: np.ndarray, parameters: PyTree) -> float | None:
        """How far a periodic orbit is from one of half the period run through twice,
        in lengths of steps; None where the problem has no such solutions."""


class Unique(AbstractRepresentation):
    """Each solution is one state."""

    family: str = eqx.field(static=True)

    def copies(self, u, tangent):
        return [(self.family, u, tangent)]

    def brought_near(self, states, u):
        del u
        return states

    def half_away(self, u, parameters):
        del u, parameters
        return None
