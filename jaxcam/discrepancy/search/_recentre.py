"""Merge a stiffness and a force of the same argument by moving the stiffness's centre.

A stiffness `g(a) (q - c)` with an unknown centre c is the sum of a stiffness
`g(a) (q - m)` about the assumed centre m and the force `(m - c) g(a)`.
"""

import dataclasses

import numpy as np

from ..terms import Factor, free_basis
from ._free_fits import FreeFits, Missing, Subset
from ._slots import emptied, Free


# Number of points at which the two functions are compared
_GRID = 400
# Number of times the centre is estimated
_ROUNDS = 2
# Correlation above which the two functions may be one stiffness
_ALIKE = 0.9


def recentred(fits: FreeFits, found: Missing) -> Missing:
    """Return the fit with one function instead of two, if that has more evidence."""
    curves = [f for f in found.functions if isinstance(f, Free) and f.smooth]
    for one in curves:
        other = _partner(curves, one)
        if other is None or not _proportional(found, one, other):
            continue
        both = found
        for _ in range(_ROUNDS):
            moved = _moved(both, one, other)
            rest = tuple(f for f in both.functions if f.slot != one.slot)
            subset = Subset(found.problem, (moved, *rest), found.names)
            both = fits.fitted(subset, both.fit.point)
            one = _in_slot(both, one)
        moved = _moved(both, one, other)
        rest = tuple(f for f in both.functions if f.slot not in (one.slot, other.slot))
        values = emptied(found.problem, both.fit.point.values, other.slot)
        alone = fits.fitted(
            Subset(found.problem, (moved, *rest), found.names),
            both.fit.point._replace(values=values),
        )
        if alone.score < found.score:
            return alone
    return found


def _in_slot(found: Missing, one: Free) -> Free:
    """Return the function of a fit that is in the same slot as a given one."""
    (fresh,) = (f for f in found.functions if f.slot == one.slot)
    assert isinstance(fresh, Free)
    return fresh


def _partner(curves: list[Free], one: Free) -> Free | None:
    """Return the force that depends on the same argument as a stiffness, if any."""
    if one.family.factor is not Factor.DEFLECTION:
        return None
    alike = dataclasses.replace(one.family, factor=Factor.ONE)
    return next((f for f in curves if f.family.name == alike.name), None)


def _proportional(found: Missing, one: Free, other: Free) -> bool:
    stiffness, force = (_values(found, f) for f in (one, other))
    sizes = np.linalg.norm(stiffness) * np.linalg.norm(force)
    return abs(float(stiffness @ force)) > _ALIKE * float(sizes)


def _moved(found: Missing, one: Free, other: Free) -> Free:
    """Return the stiffness about the centre that the force suggests."""
    stiffness, force = (_values(found, f) for f in (one, other))
    shift = float(stiffness @ force) / max(float(stiffness @ stiffness), 1e-300)
    family = dataclasses.replace(one.family, middle=one.family.middle - shift)
    return dataclasses.replace(one, family=family)


def _values(found: Missing, one: Free) -> np.ndarray:
    along = np.linspace(one.family.low, one.family.high, _GRID)
    basis = free_basis(one.family, along, len(one.coefficients))
    return basis @ np.array([found.fit[name].value for name in one.coefficients])
