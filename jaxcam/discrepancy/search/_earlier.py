"""Fit the functions that an earlier search found, with looser joints or in more
recordings.
"""

import dataclasses
import math
from collections.abc import Sequence

import jax.numpy as jnp
import numpy as np
from scipy.optimize import least_squares

from ...fitting.engine import Point
from ..terms import (
    Bivariate,
    Family,
    free_basis,
    Gate,
    Place,
    Primitive,
    terms_of,
    Where,
)
from ._free_fits import Missing, Subset
from ._free_search import FreeSearch
from ._slots import Free
from ._starting_at import starting_at


# Number of points at which a function of another range is compared with the same
# function
_GRID = 400
# Number of points of each argument of a function of two arguments
_SIDE = 40


def refitted(search: FreeSearch, earlier: Sequence[Missing]) -> Missing | None:
    """Fit functions and terms of an earlier search to the problem of another search.

    All fits count as tried by the search, because model errors that were allowed for or
    recordings left out may have affected their order.

    **Returns:** the fit with the most evidence, or `None` if there is none.
    """
    best, candidates = None, [one for one in earlier if one.functions]
    for one in candidates:
        if search.clock.over:
            break
        known = _for_search(search, one)
        if known is None:
            continue
        subset, point = known
        names = ", ".join(part.label for part in subset.functions)
        search.progress(f"fitting again {names}", None)
        beaten = math.inf
        if best is not None:
            beaten = search.policy.form_cost * best.fit.cost
        trial = search.fits.fitted(subset, point, search.policy.iterations, beaten)
        if not math.isfinite(trial.score) or not _sound(trial):
            continue
        search.tried.append(trial)
        if best is None or trial.score < best.score:
            best = trial
    return best


def rank_decoys(search: FreeSearch, found: Missing) -> None:
    """Rank the candidates for the first function of a search that need not run, if one
    of the functions found has a decoy.
    """
    if all(one.label not in _labels(search) for one in found.functions):
        return
    nothing = Subset(search.apart, (), frozenset())
    bare = search.fits.fitted(nothing, search.apart.start, search.policy.iterations)
    if not math.isfinite(bare.score):
        return
    search.first = search.leads.ranked(search.apart, bare, True)


def _labels(search: FreeSearch) -> set[str]:
    """Return the labels of the functions of one argument that act in flight."""
    return {one.name for one in search.families if one.where is Where.FLIGHT}


def _for_search(search: FreeSearch, one: Missing) -> tuple[Subset, Point] | None:
    """Return functions and terms for the problem of a search, and a starting point;
    `None` if it has no place for them.
    """
    families = {f.name: f for f in search.families}
    problem = search.rooms.for_functions(one.functions).whole
    labels = {getattr(term, "label", "") for term in terms_of(problem.model)}
    point = starting_at(one.fit, problem)
    values, functions = np.array(point.values), []
    for part in one.functions:
        if not isinstance(part, Free) or part.slot not in labels:
            return None
        numbers = np.array([one.fit[name].value for name in part.coefficients])
        moved = _over_range(part, numbers, families)
        if moved is None:
            return None
        part, numbers = moved
        columns = [problem.names.index(name) for name in part.coefficients]
        values[:, columns] = numbers
        functions.append(part)
    subset = Subset(problem, tuple(functions), one.names)
    return subset, point._replace(values=jnp.asarray(values))


def _over_range(
    one: Free, numbers: np.ndarray, families: dict[str, Family]
) -> tuple[Free, np.ndarray] | None:
    """Return a function with the ranges of other recordings, and the parameters with
    which it is closest to the given one; `None` if no family has its argument.
    """
    family = _alike(one.family, families)
    if family is None:
        return None
    if one.across is not None:
        across = _alike(one.across, families)
        return across and _bivariate_over_range(one, numbers, family, across)
    if one.primitive is None:
        along = np.linspace(family.low, family.high, _GRID)
        before = np.clip(along, one.family.low, one.family.high)
        old = free_basis(one.family, before, len(numbers))
        new = free_basis(family, along, len(numbers))
        numbers = np.linalg.lstsq(new, old @ numbers, rcond=1e-6)[0]
        return dataclasses.replace(one, family=family), numbers
    count, gate = one.primitive.count, one.gate
    moved = _closest(one.primitive, numbers[:count], one.family, family)
    if gate is not None:
        other = _alike(gate.family, families)
        if other is None:
            return None
        own = np.append(1.0, numbers[count:])
        own = _closest(gate.primitive, own, gate.family, other)
        moved = np.append(own[0] * moved[0], [*moved[1:], *own[1:]])
        gate = Gate(other, gate.primitive)
    return dataclasses.replace(one, family=family, gate=gate), moved


def _bivariate_over_range(
    one: Free, numbers: np.ndarray, family: Family, across: Family
) -> tuple[Free, np.ndarray]:
    """Return a function of two arguments with the ranges of other recordings."""
    assert one.across is not None
    moved = dataclasses.replace(one, family=family, across=across)
    earlier, other = Bivariate(one.family, one.across), Bivariate(family, across)
    grid = [np.linspace(f.low, f.high, _SIDE) for f in (family, across)]
    pairs = [at.ravel() for at in np.meshgrid(*grid)]
    # beyond its ends, a function is constant
    inside = [np.clip(at, f.low, f.high) for f, at in zip(earlier, pairs)]
    old, new = earlier.basis(*inside), other.basis(*pairs)
    return moved, np.linalg.lstsq(new, old @ numbers, rcond=1e-6)[0]


def _alike(family: Family, families: dict[str, Family]) -> Family | None:
    """Return the family with the same argument and place; a centre that was moved is
    kept.
    """
    found = families.get(family.name)
    return found and dataclasses.replace(found, middle=family.middle)


def _closest(
    form: Primitive, numbers: np.ndarray, old: Family, new: Family
) -> np.ndarray:
    """Return the parameters of a form for another range of its argument."""
    if (old.low, old.high) == (new.low, new.high):
        return numbers
    along = np.linspace(new.low, new.high, _GRID)
    turned = np.sign(along) if new.jumps else np.zeros(_GRID)
    there, here = (Place.between(along, f.low, f.high) for f in (old, new))
    wanted = np.broadcast_to(form.value(there, numbers, turned), along.shape)
    start, width = np.array(numbers, dtype=float), new.high - new.low
    for k in form.places:
        start[k] = (old.low + numbers[k] * (old.high - old.low) - new.low) / width

    def off(moved):
        return np.broadcast_to(form.value(here, moved, turned), along.shape) - wanted

    sizes = np.array([abs(numbers[0]) or 1.0, *form.scales])
    return least_squares(off, start, x_scale=sizes).x


def _sound(trial: Missing) -> bool:
    """Return whether the forms of a fit have valid parameters."""
    return all(
        one.within([trial.fit[name].value for name in one.coefficients])
        for one in trial.functions
        if isinstance(one, Free) and one.primitive is not None
    )
