"""Divide a branch into lines of one stability, and make them smooth."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import Akima1DInterpolator


# number of drawn points from one point of a branch to the next
_BETWEEN = 12


class Line(NamedTuple):
    """A part of a branch to be drawn as one line."""

    parameters: np.ndarray
    """Values of the parameter, shape `(k,)`."""
    values: np.ndarray
    """Values to draw against it, shape `(k, columns)`."""
    stable: bool | None
    """Whether the orbits are stable; None if stability is not known."""


def lines_of(points: Sequence[Any], values: Sequence[np.ndarray]) -> list[Line]:
    """Return the lines of a branch.

    A line ends at each special point, and where the stability or the number of values
    changes. At a special point, stability is undefined; that of a line follows from
    the points between its ends.

    **Arguments:** the points in order, and the values to draw at each, shape `(m,)`.
    """
    number = len(points)
    known = stability_between(points)
    found, begin = [], 0
    for k in range(1, number):
        joined = len(values[k]) == len(values[k - 1])
        if not joined:
            found.append((begin, k - 1))
            begin = k
        elif k + 1 == number or points[k].special or known[k] != known[k - 1]:
            found.append((begin, k))
            begin = k
    lines = []
    for first, last in found:
        if last > first:
            part = slice(first, last + 1)
            curves = _smooth(points[part], np.array(values[part]))
            lines.append(Line(curves[:, 0], curves[:, 1:], known[first]))
    return lines


def stability_between(points: Sequence[Any]) -> list[bool | None]:
    """Return for each point but the last whether the orbits up to the next point are
    stable.

    A part without any point of known stability, such as one between two special points,
    has the stability of the part before it or else after it; None if there is none.
    """

    def known(point) -> bool | None:
        unknown = point.special or point.stable is None
        return None if unknown else bool(point.stable)

    found = []
    for first, second in zip(points[:-1], points[1:], strict=True):
        ends = [one for one in (known(second), known(first)) if one is not None]
        found.append(ends[0] if ends else None)
    for order in (range(1, len(found)), range(len(found) - 2, -1, -1)):
        for k in order:
            if found[k] is None:
                found[k] = found[k - order.step]
    return found


def _smooth(points: Sequence[Any], values: np.ndarray) -> np.ndarray:
    """Return points on a smooth curve of the parameter and the values through the given
    points, shape `(k, 1 + columns)`.
    """
    rows = np.column_stack([[point.parameter for point in points], values])
    along = np.array([point.arclength for point in points])
    if len(rows) < 3 or not np.all(np.diff(along) > 0) or not np.all(np.isfinite(rows)):
        return rows
    steps = np.arange((len(rows) - 1) * _BETWEEN + 1) / _BETWEEN
    fine = np.interp(steps, np.arange(len(rows)), along)
    curve = Akima1DInterpolator(along, rows)(fine)
    # the last point is exact, but may lie outside the interpolant because of rounding
    curve[-1] = rows[-1]
    return curve
