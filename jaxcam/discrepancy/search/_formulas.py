"""Replace free functions by parametric forms, fitted to the recordings.

The free function gives the starting values of a form; the evidence of a fit to whole
trajectories decides whether the form is kept.
"""

import dataclasses
import itertools
import math

import numpy as np

from ...fitting import Problem
from ..terms import Family, free_basis, Place, Primitive
from ._free_fits import FreeFits, heat_of, Missing, Subset
from ._hidden_state import Hidden
from ._leads import shows_apart
from ._roughness import beside, Roughness
from ._slots import emptied, Free, replaced


# Number of points at which a form is compared with the sines that represent it
_GRID = 400


def formulated(
    fits: FreeFits, found: Missing, apart: Problem, small: float, progress
) -> tuple[Missing, list[Missing]]:
    """Replace the functions of a fit by forms that have as much evidence.

    **Arguments:** `apart`: the problem with disconnected pieces. `small`: an increase
    of the cost above which a form is not fitted further.

    **Returns:** the fit, and all fits with forms.
    """
    tried: list[Missing] = []
    for slot in [one.slot for one in found.functions]:
        # a fit of another function may have renewed it
        one = _in_slot(found, slot)
        if isinstance(one, Hidden) or not one.smooth:
            continue
        sound = _tried(fits, found, apart, one, small, progress)
        tried += sound
        best = min(sound, key=lambda trial: trial.score, default=found)
        if best.score < found.score + fits.policy.form_loss:
            found = best
    return found, tried


def _tried(
    fits: FreeFits, found: Missing, apart: Problem, one: Free, small: float, progress
) -> list[Missing]:
    """Fit the promising forms of a function; return the fits that make sense.

    A form with an exponent is followed by its special case for an exponent of one,
    which has one parameter less.
    """
    sound: list[Missing] = []
    waiting, done, least = _promising(fits, found, one), set(), -math.inf
    while waiting:
        gain, primitive, numbers = waiting.pop(0)
        if gain < least:
            break
        if primitive.name in done:
            continue
        done.add(primitive.name)
        progress(f"fitting a formula: {primitive.name}", None)
        trial = _fitted(fits, found, apart, one, primitive, numbers, small)
        if trial is None or not _sound(trial, one):
            continue
        sound.append(trial)
        if trial.score < found.score:
            # only a form that promises as much may have more evidence
            least = max(least, gain - fits.policy.leads)
        if primitive.special is not None:
            names = _in_slot(trial, one.slot).coefficients[:-1]
            start = np.array([trial.fit[name].value for name in names])
            waiting.insert(0, (gain, primitive.special, start))
    return sound


def _in_slot(found: Missing, slot: str):
    """Return the function of a fit that occupies a slot."""
    return next(one for one in found.functions if one.slot == slot)


def _sound(trial: Missing, one: Free) -> bool:
    """Return whether a form has finite evidence and parameters that make sense."""
    form = _in_slot(trial, one.slot)
    assert isinstance(form, Free) and form.primitive is not None
    numbers = [trial.fit[name].value for name in form.coefficients]
    return math.isfinite(trial.score) and form.primitive.within(numbers)


def leaves_noise(fits: FreeFits, found: Missing, small: float = 0.0) -> bool:
    """Return whether the cost of a fit is that of the noise.

    **Arguments:** `small`: a residual gain that is tolerated; a clearly smaller one
    does not count.
    """
    samples = found.problem.samples
    surplus = fits.policy.cost_errors * math.sqrt(2 * samples)
    return found.fit.cost < samples + max(surplus, fits.policy.enough * small)


def _fitted(
    fits: FreeFits,
    found: Missing,
    apart: Problem,
    one: Free,
    primitive: Primitive,
    numbers,
    small: float,
) -> Missing | None:
    """Fit a form in place of a function, starting from given parameters.

    **Returns:** the fit, or `None` if the form does not even explain individual
    pieces.
    """
    problem = found.problem
    size = Roughness(size=abs(float(numbers[0])))
    form = dataclasses.replace(one, primitive=primitive, roughness=size)
    functions = tuple(form if f.slot == one.slot else f for f in found.functions)
    values = emptied(problem, found.fit.point.values, one.slot)
    columns = [problem.names.index(name) for name in form.coefficients]
    values = replaced(values, columns, numbers)
    point = found.fit.point._replace(values=values)
    beaten = max(fits.policy.outdone * found.fit.cost, found.fit.cost + small)
    if shows_apart(one.family):
        # with disconnected pieces the fit is almost linear
        subset = Subset(apart, functions, found.names)
        first = fits.fitted(subset, point, beaten=beaten)
        if not first.fit.cost < beaten:
            return None
        point, functions = first.fit.point, first.functions
    subset = Subset(problem, functions, found.names)
    trial = fits.fitted(subset, point, beaten=beaten)
    return trial if trial.fit.cost < beaten else None


def _promising(
    fits: FreeFits, found: Missing, one: Free
) -> list[tuple[float, Primitive, np.ndarray]]:
    """Return the forms most similar to a function where the data determine it: their
    predicted gain and their parameters.

    This uses the quadratic likelihood about the fit, in which a form with size s and
    sines b has the cost of the coefficients `s b`.
    """
    heat, labels = heat_of(found.fit), one.coefficients
    subset = Subset(found.problem, found.functions, found.names)
    quadratic = fits.quadratic(subset, found.fit.point, heat, one)
    inside, pull = beside(*quadratic, fits.policy.alike)
    columns = [found.problem.names.index(name) for name in labels]
    value = np.asarray(found.fit.point.values)[0, columns]
    slope = inside @ value + pull
    price = math.log(found.problem.samples)
    ranked = []
    for primitive in one.family.primitives:
        starts = np.array(list(itertools.product(*primitive.starts)))
        starts = starts.reshape(len(starts), primitive.count - 1)
        sines = _sines_of(one.family, primitive, starts, len(labels))
        told = sines @ slope
        seen = np.einsum("ka,ab,kb->k", sines, inside, sines)
        seen = np.where(seen > 0, seen, np.inf)
        gains = told**2 / seen
        k = int(np.argmax(gains))
        size = told[k] / seen[k]
        if size != 0:
            numbers = np.array([size, *starts[k]])
            ranked.append((gains[k] - primitive.count * price, primitive, numbers))
    ranked.sort(key=lambda each: -each[0])
    return ranked[: fits.policy.followed]


def _sines_of(family: Family, primitive: Primitive, starts, count: int) -> np.ndarray:
    """Return the coefficients `(k, count)` of the sums of sines nearest to forms of
    size one.
    """
    along = np.linspace(family.low, family.high, _GRID)
    basis = free_basis(family, along, count)
    direction = np.tanh(along / family.slip) if family.jumps else np.zeros(_GRID)
    place = Place.between(along[None], family.low, family.high)
    numbers = [np.ones((len(starts), 1)), *starts.T[:, :, None]]
    values = primitive.value(place, numbers, direction[None])
    values = np.broadcast_to(values, (len(starts), _GRID))
    return np.linalg.lstsq(basis, values.T, rcond=1e-6)[0].T
