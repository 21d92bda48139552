"""Try forces that depend on two arguments: products of two forms, and free functions.

They are tried first if a free function of two arguments promises more than functions of
one argument and their sums. Otherwise they are tried if functions of one argument leave
something to explain, and if a free function of two arguments promises more than the
best function of one.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..terms import Bivariate, Family, Where
from ._bivariate_likelihood import (
    bivariate_forces,
    BivariateLikelihood,
    likelihood_of,
    Nodes,
)
from ._clock import Clock
from ._free_fits import FreeFits, Missing, Subset
from ._heat import heat_of, heated
from ._leads import Lead
from ._local_force import force_response, forces_at_nodes
from ._product_forms import ProductSearch, ProductStart
from ._product_search import Products
from ._rooms import Rooms
from ._roughness import beside, occam_of, roughness
from ._slots import filled, Free, free_term, ROOM_OF_TWO_ARGUMENTS
from ._starting_at import starting_at
from ._unexplained import leaves_noise


class Sum(NamedTuple):
    """A sum of two functions of one argument each, with priors of the same length."""

    first: Family
    second: Family

    def prior_variances(self, count: int, length: float) -> Float[np.ndarray, " count"]:
        """Return the variances of the coefficients of functions of variance one."""
        return np.concatenate([f.prior_variances(count // 2, length) for f in self])


class _Promised(NamedTuple):
    """The free functions of two arguments about a fit, the most promising first."""

    bare: Missing
    nodes: Nodes
    likelihoods: list[BivariateLikelihood]


class TwoArguments:
    """Fits of forces of two arguments.

    **Arguments:** the fits of subsets, families of functions of one argument, the
    problems with room for the functions, `progress(sentence, fraction)`, and the clock.
    """

    def __init__(
        self,
        fits: FreeFits,
        families: Sequence[Family],
        rooms: Rooms,
        progress: Callable[[str, float | None], None],
        clock: Clock,
    ):
        self.fits, self.rooms, self.policy = fits, rooms, fits.policy
        self.families = bivariate_forces(families)
        self.forces = [one for one in families if one.where is Where.FLIGHT]
        self.progress, self.clock = progress, clock
        self.products = Products(fits, rooms.plain, progress, clock)
        self._known: _Promised | None = None

    def promised(self, bare: Missing) -> float:
        """Return the largest predicted gain of a free function of two arguments."""
        likelihoods = self._promising(bare).likelihoods
        return likelihoods[0].rough.gain if likelihoods else 0.0

    def promise_more(self, bare: Missing, leads: Sequence[Lead], least: float) -> bool:
        """Return whether a free function of two arguments promises more than any
        candidate of one argument, and than sums of two functions. Compared are the sums
        with one of the candidates, and those of functions of the same two arguments.

        **Arguments:** the fit without functions; the candidates of one argument, the
        best first; and the gain by which it must exceed them.
        """
        promised = self.promised(bare)
        if promised < leads[0].gain + least:
            return False
        nodes = self._promising(bare).nodes
        at_nodes = {
            one: _of_unit_size(forces_at_nodes(nodes.response, [free_term(one, "new")]))
            for one in self.forces
        }
        first = [lead.family for lead in leads if lead.family in at_nodes]
        sums = [{one, other} for one in first for other in at_nodes if one != other]
        # each sum once
        for pair in {frozenset(one) for one in (*sums, *map(set, self.families))}:
            both = np.concatenate([at_nodes[one] for one in pair], axis=-1)
            if self._gain(nodes, both, Sum(*pair)) > promised - least:
                return False
        return True

    def tried(
        self, bare: Missing, found: Missing, least: float, small: float
    ) -> list[Missing]:
        """Return fits with a force of two arguments alone.

        A single form that leaves only noise has no rival among them.

        **Arguments:** the fit without functions, the fit with those found, the gain
        that a free function of two arguments must exceed, and the tolerated residual.
        """
        alone = len(found.functions) == 1 and not found.names
        whole = alone and not any(one.smooth for one in found.functions)
        if whole and leaves_noise(self.fits, found, small):
            return []
        _, nodes, likelihoods = self._promising(bare)
        likelihoods = [one for one in likelihoods if one.rough.gain > least]
        starts = self._products_of(nodes, likelihoods)
        beaten = self.policy.form_cost * found.fit.cost
        # with wrong forms, a product takes many iterations; a free function takes few
        likely = [one for one in starts if one.gain > likelihoods[0].rough.gain]
        trials = self.products.tried(likely, bare.fit.point, beaten)
        for likelihood in likelihoods:
            best = min((found, *trials), key=lambda one: one.score)
            gain = likelihood.rough.gain
            close = gain > self.policy.rivalling * likelihoods[0].rough.gain
            promised = bare.fit.cost - heat_of(bare.fit) * gain
            noise = best.functions and leaves_noise(self.fits, best, small)
            if noise or self.clock.over:
                break
            if not close or promised > best.fit.cost:
                break
            free = self._free(bare, likelihood, best.fit.cost)
            if free is not None:
                trials += [free, *self._formulated(free, small)]
        if not trials:
            trials = self.products.tried(starts, bare.fit.point, beaten)
        return trials

    def _promising(self, bare: Missing) -> _Promised:
        """Return the free functions, in the order of their predicted gains."""
        if self._known is None or self._known.bare is not bare:
            self.progress(
                "searching the residuals for functions of two arguments", None
            )
            heat = heat_of(bare.fit)
            problem = heated(filled(bare.problem, bare.functions), heat)
            response = force_response(problem, bare.fit.point, self.fits.free(bare))
            nodes = Nodes.of(problem, response, heat)
            every = [likelihood_of(nodes, one, self.policy) for one in self.families]
            every.sort(key=lambda one: -one.rough.gain)
            self._known = _Promised(bare, nodes, every)
        return self._known

    def _gain(self, nodes: Nodes, forces: Float[np.ndarray, "r k l p"], prior) -> float:
        """Return the predicted gain of functions given at the nodes."""
        zero = np.zeros(forces.shape[-1])
        return roughness(*nodes.quadratic(forces), prior, zero, self.policy).gain

    def _products_of(
        self, nodes: Nodes, likelihoods: Sequence[BivariateLikelihood]
    ) -> list[ProductStart]:
        """Return products of forms that resemble free functions, the most promising
        first.
        """
        alike, found = self.policy.distinct_information, []
        for one in likelihoods:
            found += ProductSearch(one, self._price).promising(nodes, alike)
        return sorted(found, key=lambda one: -one.gain)

    @property
    def _price(self) -> float:
        """Return the price of a parameter."""
        return math.log(self.rooms.plain.whole.samples)

    def _free(
        self, bare: Missing, likelihood: BivariateLikelihood, beaten: float
    ) -> Missing | None:
        """Fit a free function to single pieces of flight, then to whole recordings.

        **Returns:** the fit, or `None` if it does not explain more than other fits.
        """
        first, second = likelihood.family
        one = Free(first, likelihood.rough, ROOM_OF_TWO_ARGUMENTS, across=second)
        self.progress(f"fitting {one.label}", None)
        room, trial, functions = self.rooms.with_two_arguments, None, (one,)
        point, most = starting_at(bare.fit, room.whole), beaten
        for problem in room.stages:
            subset = Subset(problem, functions, frozenset())
            trial = self.fits.fitted(subset, point, self.policy.iterations, most)
            point, functions = trial.fit.point, trial.functions
            if not trial.fit.cost < beaten:
                return None
            # a force that explains single pieces may take many steps to connect them
            most = math.inf
        assert trial is not None
        return trial if math.isfinite(trial.score) else None

    def _formulated(self, free: Missing, small: float) -> list[Missing]:
        """Return fits with products of forms that resemble a fitted free function."""
        likelihood, freedom = self._about(free)
        heat, cost = heat_of(free.fit), free.fit.cost
        worse = heat * freedom + small + self.policy.form_loss + self.policy.lead_bic
        starts = [
            one
            for one in ProductSearch(likelihood, self._price).likely()
            if heat * (likelihood.rough.gain - one.gain) < worse
        ]
        point = starting_at(free.fit, self.rooms.plain.whole)
        beaten = max(self.policy.form_cost * cost, cost + small)
        return self.products.tried(starts, point, beaten)

    def _about(self, free: Missing) -> tuple[BivariateLikelihood, float]:
        """Return the likelihood of a free function about its fit, and the price of its
        coefficients.
        """
        (one,) = free.functions
        assert isinstance(one, Free) and isinstance(one.prior, Bivariate)
        subset = Subset(free.problem, free.functions, free.names)
        quadratic = self.fits.quadratic(subset, free.fit.point, heat_of(free.fit), one)
        inside, pull = beside(*quadratic, self.policy.distinct_information)
        value = np.array([free.fit[name].value for name in one.coefficients])
        slope = inside @ value + pull
        gain = float(2 * value @ slope - value @ inside @ value)
        shape = one.prior.shape
        likelihood = BivariateLikelihood(
            one.prior,
            inside.reshape(*shape, *shape),
            slope.reshape(shape),
            one.roughness._replace(gain=gain),
        )
        return likelihood, occam_of(inside, one.spread)


def _of_unit_size(forces: Float[np.ndarray, "r k l p"]) -> np.ndarray:
    """Return forces scaled to a common size, so that a sum of two has a prior that does
    not depend on their units.
    """
    return forces / max(float(np.sqrt(np.mean(forces**2))), np.finfo(float).tiny)
