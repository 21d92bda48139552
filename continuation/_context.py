"""Constants of a branch."""

from typing import NamedTuple

from ._settings import BranchSettings


class Context(NamedTuple):
    """The varying parameter, the scale of its changes and the accuracy.

    For a single point, the bounds are not needed.
    """

    leaf: int
    """Index of the varying parameter among the leaves of the problem's parameters."""
    width: float
    """Width of the bounds; a parameter change of this size has length one."""
    settings: BranchSettings
    bounds: tuple[float, float] = (-float("inf"), float("inf"))
