"""Find the first guard of a linear mode that falls through zero.

The motion is known on a grid of powers of the matrix exponential. Between two points of
the grid it is the Taylor series of the exponential, so a guard is a polynomial there.
An interval is searched if a guard is negative at its end, or if a bound on the second
derivative admits a minimum below zero within it.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from ._switching_linear import Law


# angle of the fastest frequency per interval of the grid, and number of its points
_ANGLE, _POINTS = 0.3, 48
# terms of the Taylor series; samples of a polynomial in one interval
_TERMS, _SAMPLES = 22, 9
# relative error of a root
_EXACT = np.float64(1e-15)
_GRID = np.linspace(0.0, 1.0, _SAMPLES)
_POWERS = np.vander(_GRID, _TERMS, increasing=True)
_SLOPES = np.zeros_like(_POWERS)
_SLOPES[:, 1:] = _POWERS[:, :-1] * np.arange(1, _TERMS)


class Fall(NamedTuple):
    """The time from the start at which a guard falls through zero, and z there."""

    after: float
    guard: int
    z: np.ndarray


class Grid:
    """The exponentials of one mode at equal intervals."""

    def __init__(self, law: Law):
        self.law = law
        fastest = np.max(np.abs(np.linalg.eigvals(law.matrix)))
        self.step = _ANGLE / max(float(fastest), 0.3)
        self.powers = np.empty((_POINTS, *law.matrix.shape))
        self.powers[0] = expm(law.matrix * self.step)
        for done in (1, 2, 4, 8, 16, 32):
            more = min(done, _POINTS - done)
            self.powers[done : done + more] = self.powers[done - 1] @ self.powers[:more]
        rows, self.rows = law.guards, []
        for _ in range(4):
            self.rows.append(rows.T)
            rows = rows @ law.matrix * self.step
        self.scaled = law.matrix * self.step

    def series(self, z) -> np.ndarray:
        """Taylor coefficients of z in units of the step, shape (terms, N)."""
        terms = np.empty((_TERMS, len(z)))
        terms[0] = z
        for i in range(1, _TERMS):
            terms[i] = self.scaled @ terms[i - 1] / i
        return terms

    def along(self, z) -> np.ndarray:
        """The points of the grid that follow z, shape (points, N)."""
        return self.powers @ z

    def suspects(self, points) -> np.ndarray:
        """The intervals between `points` in which a guard may fall through zero."""
        value, slope, bend, jerk = (
            np.abs(points @ r) if i > 1 else points @ r for i, r in enumerate(self.rows)
        )
        del slope
        bent = np.maximum(bend[:-1], bend[1:]) + 0.5 * np.maximum(jerk[:-1], jerk[1:])
        least = np.minimum(value[:-1], value[1:]) - bent / 8
        return np.flatnonzero(np.any(least <= 0, axis=1))


def first_in(grid: Grid, z, zeros: dict[int, int], end: float) -> Fall | None:
    """The first guard that falls through zero within one interval from z.

    `zeros` gives the guards that are zero at z, with the number of their leading Taylor
    coefficients that are zero; `end` is the end of the search in units of the interval.
    """
    terms = grid.series(z)
    guards = terms @ grid.rows[0]
    best, which = end, -1
    for g in range(guards.shape[1]):
        order = zeros.get(g, 0)
        coefficients = np.zeros(_TERMS)
        coefficients[: _TERMS - order] = guards[order:, g]
        # no root if the first coefficient exceeds all others together
        if coefficients[0] > np.sum(np.abs(coefficients[1:])):
            continue
        found = _first_root(coefficients, best)
        if found is not None and found <= best:
            best, which = found, g
    if which < 0:
        return None
    return Fall(best * grid.step, which, best ** np.arange(_TERMS) @ terms)


def _first_root(coefficients, end: float) -> float | None:
    """The first point in (0, end] from which a polynomial is negative, or `None`."""
    if coefficients[0] <= 0:
        return 0.0
    scale = end ** np.arange(_TERMS)
    scaled = coefficients * scale
    values, slopes = _POWERS @ scaled, _SLOPES @ scaled
    down = coefficients[::-1].tolist()
    slope_down = (coefficients[1:] * np.arange(1, _TERMS))[::-1].tolist()
    for i in range(_SAMPLES - 1):
        a, b = _GRID[i] * end, _GRID[i + 1] * end
        if values[i + 1] < 0:
            return _root(down, a, b)
        if slopes[i] < 0 < slopes[i + 1]:
            low = _root(slope_down, a, b)
            if _value(down, low) < 0:
                return _root(down, a, low)
    return None


def _root(down: list, a: float, b: float) -> float:
    # a value near zero may have either sign, depending on the order of summation
    if _value(down, a) * _value(down, b) >= 0:
        return b
    found: Any = brentq(lambda s: _value(down, s), a, b, xtol=1e-300, rtol=_EXACT)
    return found


def _value(down: list, s: float) -> float:
    total = 0.0
    for c in down:
        total = total * s + c
    return total


def first_fall(grid: Grid, z, zeros: dict[int, int], span: float, shaken=None):
    """The first fall of a guard within `span`, or z at its end (then `guard` is -1).

    `shaken` changes z at the first point of the grid.
    """
    step = grid.step
    found = first_in(grid, z, zeros, min(1.0, span / step))
    if found is not None:
        return found
    if span <= step:
        return Fall(span, -1, (span / step) ** np.arange(_TERMS) @ grid.series(z))
    start, passed = grid.powers[0] @ z, step
    if shaken is not None:
        start = shaken(start)
    while True:
        points = np.concatenate([start[None], grid.along(start)])
        for i in grid.suspects(points):
            left = span - passed - i * step
            if left <= 0:
                break
            found = first_in(grid, points[i], {}, min(1.0, left / step))
            if found is not None:
                return found._replace(after=passed + i * step + found.after)
        if passed + _POINTS * step >= span:
            i = int((span - passed) / step)
            rest = (span - passed - i * step) / step
            terms = grid.series(points[i])
            return Fall(span, -1, rest ** np.arange(_TERMS) @ terms)
        start, passed = points[-1], passed + _POINTS * step
