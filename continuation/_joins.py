"""Detect where period-doubled orbits rejoin those of half the period."""

from ._point import Point
from ._solution import Solution
from .special import BRANCH_POINT


# an orbit has half the period if its halves differ by less than this, measured like the
# length of a step; close to the flip, the difference grows as the square root of the
# change of the parameter
HALF = 1e-4
JOINS = (
    "the branch rejoins the orbits of half the period at their flip; beyond it, the "
    "same orbits would be repeated, shifted by half a period"
)


def joins(current: Solution, point: Point) -> bool:
    """Return whether the branch rejoins the orbits of half the period here.

    Those orbits form a separate branch, which is not followed a second time.
    """
    if point.kind != BRANCH_POINT:
        return False
    problem, parameters = current.problem, getattr(point.problem, "parameters")
    half_away = problem.representation.half_away
    before = half_away(current.at.z[:-1], parameters)
    away = half_away(point.state, parameters)
    if before is None or away is None:
        return False
    return away < min(HALF, 1e-2 * before)
