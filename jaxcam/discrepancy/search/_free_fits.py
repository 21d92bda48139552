"""Fits with free functions, as rough as their evidence says."""

import dataclasses
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ...fitting import Fit, fit, Problem
from ...fitting.engine import Point
from ..policy import Policy
from ..terms import Term
from ._blocks import blocks_of
from ._given_up import given_up
from ._roughness import occam, roughness
from ._slots import filled, Free


class Missing(NamedTuple):
    """The result: `functions` and `names` of terms, fitted together with the rig.

    - `score`: minus twice the logarithm of the evidence (the BIC where there is no
        function).
    - `problem`: with room for the functions; that of `fit` holds their priors.
    """

    functions: tuple[Free, ...]
    names: frozenset[str]
    fit: Fit
    score: float
    problem: Problem


class Subset(NamedTuple):
    """A subset to fit: functions and names of terms in a problem."""

    problem: Problem
    functions: tuple[Free, ...]
    names: frozenset[str]


class FreeFits:
    """Fits of subsets with free functions.

    While a model is far from the data, with a cost per sample of T, likelihoods are
    divided by T, so that parameters of the rig do not leave their tolerances to make up
    for what has not been found yet.

    **Arguments:** names of the rig's own parameters, terms that may be named, policy.
    """

    def __init__(self, rig: Sequence[str], terms: Sequence[Term], policy: Policy):
        self.rig, self.terms, self.policy = tuple(rig), tuple(terms), policy

    def free(self, found: Missing | Subset) -> list[str]:
        """Names of the parameters that are free: of the rig, terms and functions."""
        names = list(self.rig)
        for term in self.terms:
            if term.name in found.names:
                names += [one.name for one in term.strengths()]
        for one in found.functions:
            names += one.coefficients
        return names

    def fitted(
        self, subset: Subset, start: Point, iterations: int | None = None
    ) -> Missing:
        """A subset fitted, with the roughness that its functions turn out to have."""
        policy, functions = self.policy, subset.functions
        heat, point, found = 1.0, start, None
        for turn in range(policy.heats):
            last = turn + 1 == policy.heats
            problem = filled(subset.problem, functions)
            free = self.free(subset)
            found = fit(
                heated(problem, heat),
                free=free,
                start=point,
                iterations=iterations or policy.quick_iterations,
                stop=self._stop(problem.samples, heat),
            )
            point, before, heat = found.point, heat, heat_of(found)
            if not math.isfinite(found.cost):
                break
            settled = max(heat, before) < policy.heated * min(heat, before)
            if functions and not last:
                fresh = self._rougher(subset, functions, point, heat)
                settled = settled and _alike(fresh, functions)
                functions = functions if settled else fresh
            if settled:
                break
        assert found is not None
        subset = subset._replace(functions=functions)
        score = self.score(subset, found)
        return Missing(functions, subset.names, found, score, subset.problem)

    def _stop(self, samples: int, heat: float) -> Callable[[Sequence[float]], bool]:
        """Ends a fit that is given up, or whose steps no longer change a choice."""
        gives_up = given_up(samples, self.policy)

        def stop(costs: Sequence[float]) -> bool:
            steps = list(dict.fromkeys(costs))
            few = len(steps) > 3 and steps[-3] - steps[-1] < heat
            return gives_up(costs) or few

        return stop

    def quadratic(self, subset: Subset, point: Point, heat: float, one: Free):
        """The likelihood about a point for one function, without its own prior.

        **Returns:** information and score, with the coefficients of that function in
        their own units, the rows of all free parameters, and its own.
        """
        bare = heated(filled(subset.problem, subset.functions, prior=False), heat)
        free = self.free(subset)
        blocks = blocks_of(bare, point, names=free)
        information, score = unscaled(blocks, one.coefficients, heat)
        for other in subset.functions:
            if other is not one:
                _known(information, blocks, other)
        return information, score, blocks.rows(free), blocks.rows(one.coefficients)

    def _rougher(self, subset, functions, point, heat) -> tuple[Free, ...]:
        """The functions with the roughness that a fit of them suggests."""
        found = []
        for one in functions:
            if one.primitive is not None:
                found.append(one)
                continue
            quadratic = self.quadratic(
                subset._replace(functions=functions), point, heat, one
            )
            columns = [subset.problem.names.index(name) for name in one.coefficients]
            value = np.asarray(point.values)[0][columns]
            rough = roughness(*quadratic, one.family, value, self.policy)
            found.append(dataclasses.replace(one, roughness=rough))
        return tuple(found)

    def parts(self, found: Missing | Subset) -> dict[str, list[str]]:
        """The parameters of each term and function, by its label."""
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
            if one.primitive is None:
                freedom = heat * self._freedom(found, found.fit, [one])
            else:
                freedom = number * one.primitive.count
            prices[one.label] = freedom
        return prices

    def score(self, subset: Subset, found: Fit) -> float:
        """Minus twice the logarithm of the evidence, up to a constant."""
        count = sum(len(t.strengths()) for t in self.terms if t.name in subset.names)
        count += sum(f.primitive.count for f in subset.functions if f.primitive)
        price = count * math.log(found.problem.samples)
        rough = [one for one in subset.functions if one.primitive is None]
        return found.cost + price + self._freedom(subset, found, rough)

    def _freedom(
        self, subset: Missing | Subset, found: Fit, functions: Sequence[Free]
    ) -> float:
        """The share of some sums of sines in the logarithm of the evidence."""
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
        return occam(information, rows, own, spread, self.policy.alike)


def _known(information, blocks, one: Free) -> None:
    """Add what the roughness of a function says of its coefficients."""
    if one.primitive is None:
        rows = blocks.rows(one.coefficients)
        spread = np.where(one.spread > 0, one.spread, one.roughness.size)
        information[rows, rows] += (blocks.scale[rows] / spread) ** 2


def heat_of(found: Fit) -> float:
    """Cost per sample, one at least."""
    return max(1.0, found.cost / found.problem.samples)


def heated(problem: Problem, heat: float) -> Problem:
    """The problem with what is known beforehand as strong as the data are trusted."""
    return dataclasses.replace(
        problem,
        parameters=tuple(
            dataclasses.replace(p, tolerance=p.tolerance / math.sqrt(heat))
            if math.isfinite(p.tolerance)
            else p
            for p in problem.parameters
        ),
    )


def unscaled(blocks, names, heat: float):
    """Information and score with some parameters in their own units, by the heat."""
    information, score = (x / heat for x in blocks.total())
    unit = np.ones(len(blocks.names))
    own = blocks.rows(names)
    unit[own] = 1 / blocks.scale[own]
    return information * np.outer(unit, unit), score * unit


def _alike(fresh: Sequence[Free], functions: Sequence[Free]) -> bool:
    """Whether the roughness of functions has settled."""
    return all(
        a.primitive is not None
        or a.roughness.length == b.roughness.length
        and abs(math.log(a.roughness.size / b.roughness.size)) < 1.0
        for a, b in zip(fresh, functions)
    )
