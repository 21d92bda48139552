"""Fit free functions with the smoothness that has the most evidence."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ...fitting import Fit, fit, Problem
from ...fitting.engine import Point
from ..policy import Policy
from ..terms import Term
from ._blocks import blocks_of, values_of
from ._converged import alike, stuck
from ._gains import gain
from ._given_up import given_up
from ._heat import heat_of, heated, tolerance_at, unscaled
from ._hidden_state import Hidden, recentred, started
from ._roughness import occam, roughness
from ._slots import filled, Free, Part


class Missing(NamedTuple):
    """A fit of the rig with free `functions` and with the terms that `names` lists.

    - `score`: minus twice the logarithm of the evidence (the BIC if there is no
        function).
    - `problem`: the problem with slots for the functions; that of `fit` contains their
      priors.
    - `shuffled`: the gains of knockoffs of each force.
    - `decoys`: for each label, the predicted gain of a function of the same family that
      is reversed in time, as a fraction of the gain of the function itself.
    """

    functions: tuple[Part, ...]
    names: frozenset[str]
    fit: Fit
    score: float
    problem: Problem
    decoys: tuple[tuple[str, float], ...] = ()
    shuffled: tuple[Any, ...] = ()


class Subset(NamedTuple):
    """Functions, and names of terms, to be fitted together in a problem."""

    problem: Problem
    functions: tuple[Part, ...]
    names: frozenset[str]


class FreeFits:
    """Fits of subsets with free functions.

    While a fit is poor, with a cost per sample of T, the log-likelihood is divided by
    T, so that rig parameters do not leave their tolerances to compensate for effects
    not yet found.

    **Arguments:** names of the rig parameters, candidate terms, policy.
    """

    def __init__(self, rig: Sequence[str], terms: Sequence[Term], policy: Policy):
        self.rig, self.terms, self.policy = tuple(rig), tuple(terms), policy
        self._made: dict[Any, Missing] = {}

    def free(self, found: Missing | Subset) -> list[str]:
        """Return the names of the free parameters: those of the rig, terms and
        functions.
        """
        names = list(self.rig)
        for term in self.terms:
            if term.name in found.names:
                names += [one.name for one in term.strengths()]
        for one in found.functions:
            names += one.coefficients
        return names

    def fitted(
        self,
        subset: Subset,
        start: Point,
        iterations: int | None = None,
        beaten: float = math.inf,
    ) -> Missing:
        """Fit a subset, including the smoothness of its functions.

        A fit that does not fall below the cost `beaten` soon enough is stopped. The
        same fit is made only once.
        """
        bits = tuple(np.asarray(p).tobytes() for p in start if p is not None)
        # the problem is kept with the fit, so that its `id` is unique
        key = id(subset.problem), *subset[1:], *bits, iterations, beaten
        if key not in self._made:
            self._made[key] = self._fitted(subset, start, iterations, beaten)
        return self._made[key]

    def _fitted(self, subset: Subset, start: Point, iterations, beaten) -> Missing:
        policy, functions = self.policy, subset.functions
        heat, point, found, failed = 1.0, start, None, False
        earlier: tuple[Subset, Fit] | None = None
        costs: list[float] = []
        # in each fit, the parameters of a hidden element can change by a limited step
        hidden = any(isinstance(one, Hidden) for one in functions)
        turns = policy.prior_fits + (policy.element_fits if hidden else 0)
        for turn in range(turns):
            last = turn + 1 == turns
            problem = filled(subset.problem, functions)
            free = self.free(subset)
            found = fit(
                heated(problem, heat),
                free=free,
                start=point,
                iterations=iterations or policy.quick_iterations,
                stop=self._stop(problem.samples, beaten),
                tolerance=tolerance_at(heat),
            )
            point, before, heat = found.point, heat, heat_of(found)
            late = found.iterations >= policy.late_attempts // 2
            failed = not math.isfinite(found.cost) or late and not found.cost < beaten
            if failed:
                break
            earlier = subset._replace(functions=functions), found
            costs.append(heat)
            settled = max(heat, before) < policy.prior_settled * min(heat, before)
            if functions and not last:
                fresh = self._rougher(subset, functions, point, heat)
                if hidden and stuck(costs, fresh, functions, turns - turn - 1, policy):
                    break
                settled = settled and alike(fresh, functions)
                if not settled:
                    point = _recentred(subset.problem, fresh, functions, point)
                functions = functions if settled else fresh
            if settled:
                break
        assert found is not None
        fits = [(subset._replace(functions=functions), found)]
        if failed and earlier is not None:
            # with the smoothness that the fit before suggested, this one has failed
            fits.append(earlier)
        scored = [self._scored(*one) for one in fits]
        return min(scored, key=lambda one: (not math.isfinite(one.score), one.score))

    def _scored(self, subset: Subset, found: Fit) -> Missing:
        score = self.score(subset, found)
        return Missing(subset.functions, subset.names, found, score, subset.problem)

    def polished(self, found: Missing) -> Missing:
        """Return a fit at the optimum of its parameters, for a report."""
        heat = heat_of(found.fit)
        problem = heated(filled(found.problem, found.functions), heat)
        free, most = self.free(found), self.policy.quick_iterations
        again = fit(problem, free=free, start=found.fit.point, iterations=most)
        if not again.cost <= found.fit.cost:
            return found
        subset = Subset(found.problem, found.functions, found.names)
        return found._replace(fit=again, score=self.score(subset, again))

    def _stop(self, samples: int, beaten: float) -> Callable[[Sequence[float]], bool]:
        """Return a function that stops a fit if it has failed, or if its last steps
        gained too little to affect a choice.
        """
        gives_up = given_up(samples, self.policy, beaten)

        def stop(costs: Sequence[float]) -> bool:
            steps = list(dict.fromkeys(costs))
            heat = max(1.0, costs[-1] / samples)
            few = len(steps) > 3 and steps[-3] - steps[-1] < heat
            return gives_up(costs) or few

        return stop

    def quadratic(self, subset: Subset, point: Point, heat: float, one: Free):
        """Return the quadratic likelihood about a point without one function's prior.

        **Returns:** information and score, with the coefficients of that function in
        their own units, the rows of all free parameters, and the rows of the function.
        """
        bare = heated(filled(subset.problem, subset.functions, prior=False), heat)
        free = self.free(subset)
        blocks = blocks_of(bare, point, names=free)
        information, score = unscaled(blocks, one.coefficients, heat)
        for other in subset.functions:
            if other.slot != one.slot:
                _known(information, blocks, other)
        return information, score, blocks.rows(free), blocks.rows(one.coefficients)

    def _rougher(self, subset, functions, point, heat) -> tuple[Part, ...]:
        """Return the functions with the smoothness that a fit suggests, and the hidden
        elements with the parameters that it suggests.
        """
        found = []
        for one in functions:
            if isinstance(one, Hidden):
                found.append(recentred(subset.problem, one, point))
                continue
            if not one.smooth:
                found.append(one)
                continue
            quadratic = self.quadratic(
                subset._replace(functions=functions), point, heat, one
            )
            columns = [subset.problem.names.index(name) for name in one.coefficients]
            value = np.asarray(point.values)[0][columns]
            rough = roughness(*quadratic, one.prior, value, self.policy)
            found.append(dataclasses.replace(one, roughness=rough))
        return tuple(found)

    def needed_parts(self, found: Missing, one: Hidden) -> tuple[int, ...]:
        """Return the direct parts of an element's force that justify their parameters.

        The other parts are removed one by one, the least significant first, according
        to the quadratic likelihood about the fit.
        """
        heat = heat_of(found.fit)
        problem = heated(filled(found.problem, found.functions), heat)
        free = self.free(found)
        blocks = blocks_of(problem, found.fit.point, names=free)
        information, score = blocks.total()
        value = values_of(found.fit, blocks)
        named = dict(zip(one.direct, one.direct_parts))
        kept, rows = list(one.direct), blocks.rows(free)
        top = gain(information, score, rows)
        while kept:
            losses = {}
            for part in kept:
                gone = blocks.rows([named[k] for k in named if k not in kept])
                gone = np.union1d(gone, blocks.rows([named[part]])).astype(int)
                step = np.zeros(len(value))
                step[gone] = -value[gone]
                lost = step @ information @ step - 2 * step @ score
                moved = score - information @ step
                rest = np.setdiff1d(rows, gone)
                losses[part] = (top + lost - gain(information, moved, rest)) / heat
            least = min(losses, key=lambda part: losses[part])
            count = len(one.direct) - len(kept) + 1
            if losses[least] > count * math.log(problem.samples):
                break
            kept.remove(least)
        return tuple(kept)

    def parts(self, found: Missing | Subset) -> dict[str, list[str]]:
        """Return the parameters of each term and function, by its label."""
        own = {
            t.name: [one.name for one in t.strengths()]
            for t in self.terms
            if t.name in found.names
        }
        for one in found.functions:
            own[one.label] = one.coefficients
        return own

    def prices(self, found: Missing) -> dict[str, float]:
        """Return the gain that each term and function of a fit must exceed."""
        heat = heat_of(found.fit)
        number = heat * math.log(found.problem.samples)
        prices = {
            t.name: number * len(t.strengths())
            for t in self.terms
            if t.name in found.names
        }
        for one in found.functions:
            price = one.price(found.problem.samples)
            if one.smooth:
                price += self._freedom(found, found.fit, [one])
            prices[one.label] = heat * price
        return prices

    def score(self, subset: Subset, found: Fit) -> float:
        """Return minus twice the log-evidence, infinite if the fit has failed."""
        if not math.isfinite(found.cost):
            return math.inf
        count = sum(len(t.strengths()) for t in self.terms if t.name in subset.names)
        samples = found.problem.samples
        price = count * math.log(samples)
        price += sum(one.price(samples) for one in subset.functions)
        rough = [one for one in subset.functions if one.smooth]
        return found.cost + price + self._freedom(subset, found, rough)

    def _freedom(
        self, subset: Missing | Subset, found: Fit, functions: Sequence[Any]
    ) -> float:
        """Return the contribution of sums of sines to `score`: their Occam factor."""
        if not functions:
            return 0.0
        heat = heat_of(found)
        bare = filled(subset.problem, subset.functions, prior=False)
        bare = heated(bare, heat)
        free = self.free(subset)
        blocks = blocks_of(bare, found.point, names=free)
        names = [name for one in functions for name in one.coefficients]
        information, _ = unscaled(blocks, names, heat)
        for other in subset.functions:
            if other not in functions:
                _known(information, blocks, other)
        own, rows = blocks.rows(names), blocks.rows(free)

        def first(one: Free) -> int:
            return int(blocks.rows(one.coefficients)[0])

        ordered = sorted(functions, key=first)
        spread = np.concatenate([one.spread for one in ordered])
        return occam(information, rows, own, spread, self.policy.distinct_information)


def _known(information, blocks, one: Part) -> None:
    """Add the prior of the coefficients of a function to the information."""
    if isinstance(one, Free) and one.smooth:
        rows = blocks.rows(one.coefficients)
        spread = np.where(one.spread > 0, one.spread, one.roughness.size)
        information[rows, rows] += (blocks.scale[rows] / spread) ** 2


def _recentred(problem: Problem, fresh, functions, point: Point) -> Point:
    """Return the point with the parameters of hidden elements reset for their new
    points of linearisation.
    """
    for one, before in zip(fresh, functions):
        if one is not before and isinstance(one, Hidden):
            point = point._replace(values=started(problem, point.values, one))
    return point
