"""What stays the same along a branch."""

from typing import NamedTuple

from ._settings import BranchSettings


class Context(NamedTuple):
    """Which parameter varies, by what its changes are measured, and how accurately.

    Where a single point is looked at, the bounds do not matter.
    """

    leaf: int
    """Index among the leaves of the problem's parameters."""
    width: float
    """Of the bounds: a change by this much has length one."""
    settings: BranchSettings
    bounds: tuple[float, float] = (-float("inf"), float("inf"))
