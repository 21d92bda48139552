"""The dynamics around a solution, whose eigenvalues decide its stability."""

from collections.abc import Callable
from typing import Literal, NamedTuple

from jaxtyping import Array, Float


StabilityKind = Literal["equilibrium", "map", "none"]
"""Meaning of the eigenvalues of `linearisation`."""


class LocalDynamics(NamedTuple):
    """The vector field or map around a solution whose eigenvalues are the problem's."""

    at: Array
    """The solution, shape `(k,)`."""
    motion: Callable[[Float[Array, " k"]], Float[Array, " k"]] | None
    """The map or vector field, `(k,)` to `(k,)`, differentiable three times. None: only
    its Jacobian is known, and higher derivatives come from central differences."""
    jacobian: Callable[[Float[Array, " k"]], Float[Array, "k k"]]
    """Its Jacobian, `(k,)` to `(k, k)`."""
