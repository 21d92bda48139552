"""The likelihood of a free function, to second order in its coefficients.

It predicts how well a parametric form would explain the data, without integrating a
trajectory.
"""

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from ..terms import Family, free_basis, Place, Primitive
from ._free_fits import FreeFits, Missing, Subset
from ._heat import heat_of
from ._roughness import beside, occam_of
from ._slots import Free


# Number of points at which a form is compared with the sines that represent it
_GRID = 400
# Maximum number of evaluations when the parameters of a form are optimised
_EVALUATIONS = 40
# Step of finite differences, relative to a significant change of a parameter
_STEP = 0.02


class Start(NamedTuple):
    """A form with parameters from which a fit may start.

    `gain`: the predicted reduction of the cost, minus the price of the parameters.
    """

    gain: float
    primitive: Primitive
    numbers: np.ndarray


class CurveLikelihood(NamedTuple):
    """The likelihood of a function about its fitted coefficients, with all other free
    parameters eliminated.

    A function with coefficients c reduces the cost, divided by the cost per sample, by
    `2 c @ slope - c @ information @ c`. `gain`: this reduction for the fitted function;
    `freedom`: the price of its coefficients; `price`: that of one parameter of a form.
    """

    family: Family
    information: Float[np.ndarray, "k k"]
    slope: Float[np.ndarray, " k"]
    gain: float
    price: float
    freedom: float = 0.0

    @classmethod
    def about(cls, fits: FreeFits, found: Missing, one: Free) -> "CurveLikelihood":
        """Return the likelihood of one of the functions of a fit."""
        heat, labels = heat_of(found.fit), one.coefficients
        subset = Subset(found.problem, found.functions, found.names)
        quadratic = fits.quadratic(subset, found.fit.point, heat, one)
        inside, pull = beside(*quadratic, fits.policy.distinct_information)
        columns = [found.problem.names.index(name) for name in labels]
        value = np.asarray(found.fit.point.values)[0, columns]
        slope = inside @ value + pull
        gain = float(2 * value @ slope - value @ inside @ value)
        price, freedom = math.log(found.problem.samples), occam_of(inside, one.spread)
        return cls(one.family, inside, slope, gain, price, freedom)

    def sines_of(
        self, primitive: Primitive, numbers: Float[np.ndarray, "n p"]
    ) -> Float[np.ndarray, "n k"]:
        """Return the coefficients of the sums of sines that are closest to a form, for
        several sets of its parameters.
        """
        return sines_of(self.family, len(self.slope), primitive, numbers)


def sines_of(
    family: Family, count: int, primitive: Primitive, numbers: Float[np.ndarray, "n p"]
) -> Float[np.ndarray, "n count"]:
    """Return `count` coefficients of the sums of sines of a family that are closest to
    a form, for several sets of its parameters.
    """
    along = np.linspace(family.low, family.high, _GRID)
    direction = np.tanh(along / family.slip) if family.jumps else np.zeros(_GRID)
    place = Place.between(along[None], family.low, family.high)
    columns = list(numbers.T[:, :, None])
    values = primitive.value(place, columns, direction[None])
    values = np.broadcast_to(values, (len(numbers), _GRID))
    return values @ _projection(family, count).T


def starts_of(primitive: Primitive) -> Float[np.ndarray, "n p"]:
    """Return all starting values of the parameters of a form of size one."""
    starts = np.array(list(itertools.product((1.0,), *primitive.starts)))
    return starts.reshape(-1, primitive.count)


@functools.lru_cache(maxsize=8)
def _projection(family: Family, count: int) -> Float[np.ndarray, "k n"]:
    """Return the matrix that fits a sum of sines to values on the grid."""
    along = np.linspace(family.low, family.high, _GRID)
    return np.linalg.pinv(free_basis(family, along, count), rcond=1e-6)


class Vectors:
    """Functions as vectors, scaled so that the cost of a function exceeds the minimum
    by the squared distance from `best`, the vector of the most likely function.
    """

    def __init__(self, likelihood: CurveLikelihood):
        self.likelihood = likelihood
        values, vectors = np.linalg.eigh(likelihood.information)
        # directions without information are left out
        least = len(values) * np.finfo(float).eps * np.max(values, initial=0.0)
        kept = values > least
        self.root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
        told = vectors[:, kept].T @ likelihood.slope
        self.best = told / np.sqrt(values[kept])

    def seen(self, form: Primitive, numbers: np.ndarray) -> np.ndarray:
        """Return a form as a vector, or as one vector for each set of parameters."""
        sines = self.likelihood.sines_of(form, np.atleast_2d(numbers))
        seen = sines @ self.root.T
        return seen if numbers.ndim > 1 else seen[0]

    def slopes(self, form: Primitive, numbers, scales) -> Float[np.ndarray, "k p"]:
        """Return the derivatives of a form with respect to its parameters, in units of
        their significant changes, `scales`.
        """
        steps = numbers + _STEP * np.diag(scales)
        return (self.seen(form, steps) - self.seen(form, numbers)).T / _STEP

    def refined(self, form: Primitive, start: np.ndarray) -> Start:
        """Return a form with its parameters optimised; they may become invalid."""
        scales = np.array([abs(start[0]), *form.scales])
        # a step to parameters for which the form is not finite is shortened
        with np.errstate(over="ignore", invalid="ignore"):
            result = least_squares(
                lambda steps: self.seen(form, start + scales * steps) - self.best,
                np.zeros(len(start)),
                jac=lambda steps: self.slopes(  # pyright: ignore[reportArgumentType]
                    form, start + scales * steps, scales
                ),
                max_nfev=_EVALUATIONS,
            )
        gain = float(self.best @ self.best - result.fun @ result.fun)
        gain -= form.count * self.likelihood.price
        return Start(gain, form, start + scales * result.x)


def promising(likelihood: CurveLikelihood, most: int) -> list[Start]:
    """Return the forms with the largest predicted gains, at most `most` of them.

    The parameters are optimised from the best starting values. If the data determine a
    function precisely, the distance to the nearest starting values would otherwise cost
    more than a wrong form does.
    """
    ranked, vectors = [], Vectors(likelihood)
    for primitive in likelihood.family.primitives:
        starts = starts_of(primitive)
        sines = likelihood.sines_of(primitive, starts)
        told = sines @ likelihood.slope
        seen = np.einsum("ka,ab,kb->k", sines, likelihood.information, sines)
        seen = np.where(seen > 0, seen, np.inf)
        gains = told**2 / seen
        k = int(np.argmax(gains))
        size = told[k] / seen[k]
        if size != 0:
            numbers = np.array([size, *starts[k][1:]])
            gain = gains[k] - primitive.count * likelihood.price
            best = Start(float(gain), primitive, numbers)
            better = vectors.refined(primitive, numbers)
            sound = primitive.within(better.numbers) and better.gain > best.gain
            ranked.append(better if sound else best)
    ranked.sort(key=lambda each: -each.gain)
    return ranked[:most]
