"""The start of a branch."""

from typing import Any

import equinox as eqx
import numpy as np


class Start(eqx.Module):
    """The start of a branch: a problem, a state, and optionally a direction.

    Examples:
        >>> import continuation
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> start = continuation.Start(problem, np.ones(1), parameter=1.0)
        >>> next(continuation.follow(problem, start, "a", (-1, 2))).parameter
        1.0
    """

    problem: Any
    """The [`continuation.AbstractProblem`][] to follow."""
    state: np.ndarray
    """State on or near the branch, shape `(n,)`."""
    parameter: float | None = None
    """Value of the parameter; default: that of `problem.parameters`."""
    tangent: np.ndarray | None = None
    """Direction (state, parameter) in which the branch leaves, `(n+1,)`; its length
    does not matter. The first point is searched for in the hyperplane perpendicular to
    it, so that at a branch point the new branch is found rather than the known one.
    Default: along the branch through `state`, in the requested direction.
    """
    step: float | None = None
    """First step; default: that of the settings."""
    reason: str = eqx.field(static=True, default="")
    """A remark on the first point."""
    kind: str = eqx.field(static=True, default="")
    """Kind of the special point at `state`, if it is one that no test function
    detects.
    """
