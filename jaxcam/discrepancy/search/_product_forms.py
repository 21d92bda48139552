"""Find products of two parametric forms that resemble a function of two arguments.

The forms of either argument are compared in turn on a grid of their parameters, with
the other form fixed; the size of the product is eliminated. The most promising products
are refined, and their gains are predicted at the nodes of the pieces. No trajectory is
integrated.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from ..terms import Family, Gate, Place, Primitive
from ._bivariate_likelihood import BivariateLikelihood, Nodes
from ._curve_likelihood import sines_of, starts_of
from ._roughness import beside


# Number of rounds in which the factors of the closest product of curves are improved
_ROUNDS = 20
# Number of forms of the first argument that are combined with others, and of forms of
# the second argument for each of them
_FIRST, _SECOND = 6, 4
# Number of products that are refined, and maximum number of evaluations for each; the
# gains of all of them are predicted at once
_REFINED, _EVALUATIONS = 20, 40
# Step of finite differences, relative to a significant change of a parameter
_STEP = 0.02


class ProductStart(NamedTuple):
    """A product of two forms with parameters from which a fit may start.

    - `gain`: the predicted reduction of the cost, minus the price of the parameters.
    - `numbers`: the parameters of the first form, then those of the second one without
        its size, which is one.
    """

    gain: float
    family: Family
    primitive: Primitive
    gate: Gate
    numbers: Float[np.ndarray, " p"]

    @property
    def divided(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the parameters of both forms."""
        count = self.primitive.count
        return self.numbers[:count], np.append(1.0, self.numbers[count:])

    @property
    def scales(self) -> np.ndarray:
        """Return significant changes of the parameters."""
        size = abs(float(self.numbers[0]))
        gate = self.gate.primitive
        return np.array([size, *self.primitive.scales, *gate.scales])

    @property
    def sensible(self) -> bool:
        """Return whether the parameters of both forms are valid."""
        one, other = self.divided
        inside = self.primitive.within(one) and self.gate.primitive.within(other)
        return inside and math.isfinite(self.gain) and bool(self.numbers[0])

    def at_nodes(self, nodes: Nodes) -> Float[np.ndarray, "r k l"]:
        """Return the force at the nodes of all pieces."""
        one, other = self.divided
        first = form_at_nodes(nodes, self.family, self.primitive, one)
        gate = self.gate
        return first * form_at_nodes(nodes, gate.family, gate.primitive, other)


def form_at_nodes(
    nodes: Nodes, family: Family, form: Primitive, numbers: Float[np.ndarray, " p"]
) -> Float[np.ndarray, "r k l"]:
    """Return a form of the argument of a family at the nodes of all pieces."""
    at, direction = nodes.place(family)
    place = Place.between(at, family.low, family.high)
    return np.broadcast_to(form.value(place, numbers, direction), at.shape)


class ProductSearch:
    """A search for products of forms that are about as likely as a free function.

    **Arguments:** the likelihood of the free function, and the price of a parameter.
    """

    def __init__(self, likelihood: BivariateLikelihood, price: float):
        self.likelihood, self.price = likelihood, price
        self.families = tuple(likelihood.family)
        size = int(np.prod(likelihood.family.shape))
        whole = likelihood.information.reshape(size, size)
        values, vectors = np.linalg.eigh(whole)
        kept = values > 0
        self.root = np.sqrt(values[kept])[:, None] * vectors[:, kept].T
        told = vectors[:, kept].T @ likelihood.slope.ravel()
        self.best = told / np.sqrt(values[kept])
        self.grids = [self._grid(side) for side in (0, 1)]

    def promising(self, nodes: Nodes, alike: float) -> list[ProductStart]:
        """Return products in order of their gains predicted at the nodes.

        **Arguments:** the nodes, and the fraction of the information on a product that
        must remain when the other parameters are free.
        """
        return rescored(self.likely(), nodes, self.price, alike)

    def likely(self) -> list[ProductStart]:
        """Return products in order of the gains that the free function predicts."""
        guesses = sorted(self._guesses(), key=lambda one: -one.gain)
        found = [self._refined(one) for one in guesses[:_REFINED]]
        found = [one for one in found if one.sensible]
        return sorted(found, key=lambda one: -one.gain)

    def closest(
        self, side: int, form: Primitive, numbers: Float[np.ndarray, " p"]
    ) -> Float[np.ndarray, " a"]:
        """Return the coefficients of the curve that is closest to a form of the first
        or the second argument.
        """
        return self._sines_of(side, form, numbers[None])[0]

    def _grid(self, side: int) -> list[tuple[Primitive, np.ndarray, np.ndarray]]:
        """Return the forms of one argument, with all starting values and the
        coefficients of the closest sums of sines.
        """
        found = []
        for form in self.families[side].primitives:
            starts = starts_of(form)
            starts = starts[[form.within(own) for own in starts]]
            found.append((form, starts, self._sines_of(side, form, starts)))
        return found

    def _sines_of(self, side: int, form: Primitive, numbers) -> np.ndarray:
        """Return the coefficients of one argument that are closest to a form, for
        several sets of its parameters.
        """
        family, count = self.families[side], self.likelihood.family.shape[side]
        every = count if family.jumps else count + 1
        return sines_of(family, every, form, numbers)[:, :count]

    def _beside(self, curve: np.ndarray, side: int):
        """Return information and slope of the function on one side, given the curve of
        the other.
        """
        information, slope = self.likelihood.information, self.likelihood.slope
        if side == 0:
            inside = np.einsum("ijkl,j,l->ik", information, curve, curve)
            return inside, slope @ curve
        inside = np.einsum("ijkl,i,k->jl", information, curve, curve)
        return inside, curve @ slope

    def _curves(self) -> list[np.ndarray]:
        """Return the two curves whose product is closest to the free function."""
        rough, family = self.likelihood.rough, self.likelihood.family
        shape = family.shape
        size = int(np.prod(shape))
        spread = rough.size**2 * family.prior_variances(size, rough.length)
        limit = 1 / np.maximum(spread, np.max(spread) * np.finfo(float).eps)
        whole = self.likelihood.information.reshape(size, size) + np.diag(limit)
        mean = np.linalg.solve(whole, self.likelihood.slope.ravel()).reshape(shape)
        left, sizes, right = np.linalg.svd(mean)
        curves, limit = [left[:, 0] * sizes[0], right[0]], limit.reshape(shape)
        for turn in range(2 * _ROUNDS):
            side = turn % 2
            other = curves[1 - side] / np.linalg.norm(curves[1 - side])
            inside, told = self._beside(other, side)
            known = (limit if side == 0 else limit.T) @ other**2
            curves[1 - side] = other
            curves[side] = np.linalg.solve(inside + np.diag(known), told)
        return curves

    def _ranked(self, curve: np.ndarray, side: int, only: Primitive | None = None):
        """Return gain, form, parameters and curve of the best start of each form on one
        side, given the curve of the other, in order of their gains.
        """
        inside, told = self._beside(curve, side)
        found = []
        for form, starts, sines in self.grids[side]:
            if only is not None and form is not only:
                continue
            seen = np.einsum("ka,ka->k", sines @ inside, sines)
            seen = np.where(seen > 0, seen, np.inf)
            gains = (sines @ told) ** 2 / seen
            k = int(np.argmax(gains))
            gain = float(gains[k]) - self.price * (form.count - 1)
            found.append((gain, form, starts[k], sines[k]))
        return sorted(found, key=lambda one: -one[0])

    def _guesses(self) -> list[ProductStart]:
        """Return products of forms on the grid, one for each pair of forms."""
        found = []
        for _, first, _, curve in self._ranked(self._curves()[1], 0)[:_FIRST]:
            for _, second, other, across in self._ranked(curve, 1)[:_SECOND]:
                ((_, _, own, along),) = self._ranked(across, 0, first)
                ((_, _, other, across),) = self._ranked(along, 1, second)
                gate = Gate(self.families[1], second)
                numbers = np.concatenate([own, other[1:]])
                one = ProductStart(0.0, self.families[0], first, gate, numbers)
                found.append(self._sized(one, np.outer(along, across)))
        return found

    def _sized(self, one: ProductStart, unit: np.ndarray) -> ProductStart:
        """Return a product of size one with its best size and its gain."""
        seen = self.root @ unit.ravel()
        square = float(seen @ seen)
        size = float(seen @ self.best) / square if square > 0 else 0.0
        numbers = np.append(size, one.numbers[1:])
        gain = size**2 * square - len(numbers) * self.price
        return one._replace(gain=gain, numbers=numbers)

    def _seen(self, one: ProductStart, numbers: np.ndarray) -> np.ndarray:
        """Return a product with given parameters as a vector, scaled so that its cost
        exceeds the minimum by the squared distance from `best`.
        """
        own = one._replace(numbers=numbers).divided
        forms = one.primitive, one.gate.primitive
        pairs = enumerate(zip(forms, own))
        curves = [self.closest(side, form, values) for side, (form, values) in pairs]
        return self.root @ np.outer(*curves).ravel()

    def _refined(self, one: ProductStart) -> ProductStart:
        """Return a product with its most likely parameters."""
        if one.numbers[0] == 0:
            return one
        start, scales = one.numbers, one.scales

        def off(steps):
            return self._seen(one, start + scales * steps) - self.best

        def slopes(steps):
            moved = [off(steps + _STEP * own) for own in np.eye(len(steps))]
            return (np.stack(moved) - off(steps)).T / _STEP

        result = least_squares(
            off,
            np.zeros(len(start)),
            jac=slopes,  # pyright: ignore[reportArgumentType]
            max_nfev=_EVALUATIONS,
        )
        gain = float(self.best @ self.best - result.fun @ result.fun)
        better = one._replace(
            gain=gain - len(start) * self.price, numbers=start + scales * result.x
        )
        return better if better.sensible else one


def rescored(
    found: Sequence[ProductStart], nodes: Nodes, price: float, alike: float
) -> list[ProductStart]:
    """Return products with their gains and sizes predicted at the nodes, which, unlike
    sines, represent sharp edges; in order of their gains.
    """
    if not found:
        return []
    room = _REFINED + 1
    forces = np.stack([one.at_nodes(nodes) for one in found[:room]], axis=-1)
    forces = np.pad(forces, [(0, 0)] * 3 + [(0, room - forces.shape[-1])])
    inside, pull = beside(*nodes.quadratic(forces), alike)
    better = []
    for k, one in enumerate(found[:room]):
        if not inside[k, k] > 0:
            continue
        gain = pull[k] ** 2 / inside[k, k] - len(one.numbers) * price
        numbers = one.numbers.copy()
        numbers[0] *= pull[k] / inside[k, k]
        better.append(one._replace(gain=float(gain), numbers=numbers))
    return sorted(better, key=lambda one: -one.gain)
