"""Problems that evaluate all quantities at a point at once."""

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

from .problem import AbstractProblem


class Evaluation(NamedTuple):
    """The results of one evaluation of a problem."""

    residual: Any
    """G(u, parameters), shape `(n,)`."""
    jacobian: Any
    """Derivative of the residual with respect to (u, parameter), shape `(n, n+1)`."""
    linearisation: Any
    """As returned by `AbstractProblem.linearisation`."""
    monitors: dict[str, Any]
    """Values of the test functions."""
    observed: dict[str, Any]
    """Quantities to store."""


class AbstractAtOnce(AbstractProblem):
    """A problem whose corrector calls only `evaluated`, at one place of a program.

    This shortens compilation if the residual is a long program, of which `residual`,
    `derivatives` and `seen` would each contain a copy.
    """

    def evaluated_on_host(self, leaf: int, z) -> Evaluation | None:
        """Return all quantities, computed outside of traced programs, as NumPy arrays;
        None if the problem can only be traced.

        Args:
            leaf: Index of the varying parameter.
            z: Unknowns and parameter, shape `(n + 1,)`.
        """
        del leaf, z
        return None

    @abc.abstractmethod
    def evaluated(self, u, p, parameters_at: Callable) -> Evaluation:
        """Return all quantities at a point.

        Args:
            u: Unknowns, shape `(n,)`.
            p: Value of the parameter.
            parameters_at: Function of p that returns the parameters with the varying
                one set to p.

        Returns:
            An `Evaluation`.
        """
