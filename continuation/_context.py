"""Constants of a branch."""

from typing import NamedTuple

from ._settings import BranchSettings


class Context(NamedTuple):
    """The varying parameter, the scale of its changes, and the accuracy.

    Where a single point is looked at, the bounds do not matter.
    """

    leaf: int
    """Index among the leaves of the problem's parameters."""
    width: float
    """Of the bounds: a change by this much has length one."""
    settings: BranchSettings
    bounds: tuple[float, float] = (-float("inf"), float("inf"))
