"""The local dynamics around a solution, whose eigenvalues determine its stability."""

from collections.abc import Callable
from typing import Literal, NamedTuple

from jaxtyping import Array, Float


StabilityKind = Literal["equilibrium", "map", "none"]
"""Meaning of the eigenvalues of `linearisation`."""


class LocalDynamics(NamedTuple):
    """The vector field or map around a solution; its Jacobian has the eigenvalues of
    the linearisation.
    """

    at: Array
    """The solution, shape `(k,)`."""
    motion: Callable[[Float[Array, " k"]], Float[Array, " k"]] | None
    """The map or vector field, from `(k,)` to `(k,)`, three times differentiable. If it
    is None, only the Jacobian is known, and higher derivatives are computed by central
    differences.
    """
    jacobian: Callable[[Float[Array, " k"]], Float[Array, "k k"]]
    """The Jacobian, from `(k,)` to `(k, k)`."""
