"""Find the centre of a stiffness that depends on something other than the position.

A stiffness `g(a) (q - c)` with an unknown centre c is the sum of a stiffness
`g(a) (q - m)` about the assumed centre m and the force `(m - c) g(a)`. That force may
have been found as a second function, or be hidden in the residual.
"""

import dataclasses
import math

import numpy as np

from ..terms import Factor, free_basis
from ._bivariate_likelihood import Nodes
from ._free_fits import FreeFits, Missing, Subset
from ._gains import added_gain, newton_step
from ._heat import heat_of, heated
from ._local_force import force_response, forces_at_nodes
from ._slots import emptied, filled, Free, free_term


# Number of points at which the two functions are compared
_GRID = 400
# Number of times the centre is estimated
_ROUNDS = 2
# Correlation above which the two functions may be one stiffness
_ALIKE = 0.9


def recentred(fits: FreeFits, found: Missing) -> Missing:
    """Return the fit with one stiffness about another centre, instead of a stiffness
    and a force or of a stiffness alone, if that has more evidence.
    """
    curves = [
        f
        for f in found.functions
        if isinstance(f, Free) and f.smooth and f.across is None
    ]
    for one in curves:
        if one.family.factor is not Factor.DEFLECTION:
            continue
        one = _in_slot(found, one)
        other = _partner(curves, one)
        if other is None:
            found = _about_own_centre(fits, found, one)
            continue
        if not _proportional(found, one, other):
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


def _about_own_centre(fits: FreeFits, found: Missing, one: Free) -> Missing:
    """Return the fit with a stiffness about the centre that the residual suggests, if
    that has more evidence.
    """
    price = math.log(found.problem.samples)
    for _ in range(_ROUNDS):
        one = _in_slot(found, one)
        shift, gained = _suggested(fits, found, one)
        if gained < price:
            break
        rest = tuple(f for f in found.functions if f.slot != one.slot)
        subset = Subset(found.problem, (_shifted(one, shift), *rest), found.names)
        trial = fits.fitted(subset, found.fit.point)
        if not trial.score < found.score:
            break
        found = trial
    return found


def _suggested(fits: FreeFits, found: Missing, one: Free) -> tuple[float, float]:
    """Return the shift of the centre by the quadratic likelihood about a fit, and its
    gain in twice the log-likelihood.

    The other functions of the fit are fixed; their effect is known from the fit.
    """
    heat, point = heat_of(found.fit), found.fit.point
    problem = heated(filled(found.problem, found.functions), heat)
    response = force_response(problem, point, fits.rig)
    nodes = Nodes.of(problem, response, heat)
    force = dataclasses.replace(one.family, factor=Factor.ONE)
    stiffness, other = (
        forces_at_nodes(response, [free_term(family, "new")])
        for family in (one.family, force)
    )
    value = np.array([found.fit[name].value for name in one.coefficients])
    forces = np.concatenate([stiffness, (other @ value)[..., None]], axis=-1)
    information, score, rig, new = nodes.quadratic(forces)
    own = new[:-1]
    spread = np.where(one.spread > 0, one.spread, one.roughness.size)
    information[own, own] += 1 / spread**2
    score[own] -= value / spread**2
    free = np.concatenate([rig, own])
    alike = fits.policy.distinct_information
    step, _ = newton_step(information, score, np.append(free, new[-1]))
    return float(step[-1]), added_gain(information, score, free, new[-1:], alike)


def _partner(curves: list[Free], one: Free) -> Free | None:
    """Return the force that depends on the same argument as a stiffness, if any."""
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
    return _shifted(one, shift)


def _shifted(one: Free, shift: float) -> Free:
    """Return a stiffness with its centre moved down by `shift`."""
    family = dataclasses.replace(one.family, middle=one.family.middle - shift)
    return dataclasses.replace(one, family=family, centred=True)


def _values(found: Missing, one: Free) -> np.ndarray:
    along = np.linspace(one.family.low, one.family.high, _GRID)
    basis = free_basis(one.family, along, len(one.coefficients))
    return basis @ np.array([found.fit[name].value for name in one.coefficients])
