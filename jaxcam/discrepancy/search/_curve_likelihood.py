"""The likelihood of a free function, to second order in its coefficients.

It predicts how well a parametric form would explain the data, without a fit.
"""

import functools
import itertools
import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..terms import Family, free_basis, Place, Primitive
from ._free_fits import FreeFits, heat_of, Missing, Subset
from ._roughness import beside, occam_of
from ._slots import Free


# Number of points at which a form is compared with the sines that represent it
_GRID = 400


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
        family = self.family
        along = np.linspace(family.low, family.high, _GRID)
        direction = np.tanh(along / family.slip) if family.jumps else np.zeros(_GRID)
        place = Place.between(along[None], family.low, family.high)
        columns = list(numbers.T[:, :, None])
        values = primitive.value(place, columns, direction[None])
        values = np.broadcast_to(values, (len(numbers), _GRID))
        return values @ _projection(family, len(self.slope)).T

    def starts_of(self, primitive: Primitive) -> Float[np.ndarray, "n p"]:
        """Return all starting values of the parameters of a form of size one."""
        starts = np.array(list(itertools.product((1.0,), *primitive.starts)))
        return starts.reshape(-1, primitive.count)


@functools.lru_cache(maxsize=8)
def _projection(family: Family, count: int) -> Float[np.ndarray, "k n"]:
    """Return the matrix that fits a sum of sines to values on the grid."""
    along = np.linspace(family.low, family.high, _GRID)
    return np.linalg.pinv(free_basis(family, along, count), rcond=1e-6)


def promising(likelihood: CurveLikelihood, most: int) -> list[Start]:
    """Return the forms with the largest predicted gains, at most `most` of them."""
    ranked = []
    for primitive in likelihood.family.primitives:
        starts = likelihood.starts_of(primitive)
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
            ranked.append(Start(float(gain), primitive, numbers))
    ranked.sort(key=lambda each: -each.gain)
    return ranked[:most]
