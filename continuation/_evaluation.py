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
