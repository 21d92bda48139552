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
from ._slots import coefficients_of, filled, Free, spread_of


class Missing(NamedTuple):
    """What was found: `functions` and `names` of terms, fitted together with the rig.

    - `score`: minus twice the logarithm of the evidence (the BIC where there is no
        function).
    - `gains`: growth of the evidence by each function or term, when it was found.
    """

    functions: tuple[Free, ...]
    names: frozenset[str]
    fit: Fit
    score: float
    gains: dict[str, float]


class Subset(NamedTuple):
    """What is to be fitted: functions and names of terms in a problem."""

    problem: Problem
    functions: tuple[Free, ...]
    names: frozenset[str]
    gains: dict[str, float]


class FreeFits:
    """Fits of subsets with free functions.

    While a model is far from the data, with a cost per sample of T, likelihoods are
    divided by T, so that parameters of the rig do not leave their tolerances to make up
    for what has not been found yet.

    **Arguments:** names of the rig's own parameters, terms that may be named, policy.
    """

    def __init__(self, rig: Sequence[str], terms: Sequence[Term], policy: Policy):
        self.rig, self.terms, self.policy = tuple(rig), tuple(terms), policy

    def free(self, problem: Problem, found: Missing | Subset) -> list[str]:
        """Names of the parameters that are free: of the rig, terms and functions."""
        names = list(self.rig)
        for term in self.terms:
            if term.name in found.names:
                names += [one.name for one in term.strengths()]
        for one in found.functions:
            names += coefficients_of(problem, one.slot)
        return names

    def fitted(
        self, subset: Subset, start: Point, iterations: int | None = None
    ) -> Missing:
        """A subset fitted, with the roughness that its functions turn out to have."""
        policy, functions = self.policy, subset.functions
        heat, point, found = 1.0, start, None
        for turn in range(policy.heats):
            problem = filled(subset.problem, functions)
            free = self.free(problem, subset)
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
            if functions:
                fresh = self._rougher(problem, subset, functions, point, heat)
                settled = settled and _alike(fresh, functions)
                functions = functions if settled else fresh
            if settled:
                break
        assert found is not None
        subset = subset._replace(functions=functions)
        return Missing(
            functions, subset.names, found, self.score(subset, found), subset.gains
        )

    def _stop(self, samples: int, heat: float) -> Callable[[Sequence[float]], bool]:
        """Ends a fit that is given up, or whose steps no longer change a choice."""
        gives_up = given_up(samples, self.policy)

        def stop(costs: Sequence[float]) -> bool:
            steps = list(dict.fromkeys(costs))
            few = len(steps) > 3 and steps[-3] - steps[-1] < heat
            return gives_up(costs) or few

        return stop

    def _rougher(self, problem, subset, functions, point, heat) -> tuple[Free, ...]:
        """The functions with the roughness that a fit of them suggests."""
        bare = filled(problem, functions, prior=False)
        free = self.free(bare, subset)
        blocks = blocks_of(bare, point, names=free)
        found = []
        for one in functions:
            names = coefficients_of(bare, one.slot)
            own, rows = blocks.rows(names), blocks.rows(free)
            information, score = unscaled(blocks, names, heat)
            value = np.asarray(point.values)[0][
                [bare.names.index(blocks.names[k]) for k in own]
            ]
            # the others keep their priors
            for other in functions:
                if other is not one:
                    others = blocks.rows(coefficients_of(bare, other.slot))
                    spread = spread_of(other.family, other.roughness)
                    spread = np.where(spread > 0, spread, other.roughness.size)
                    information[others, others] += (blocks.scale[others] / spread) ** 2
            rough = roughness(
                information, score, rows, own, one.family, value, self.policy
            )
            found.append(dataclasses.replace(one, roughness=rough))
        return tuple(found)

    def score(self, subset: Subset, found: Fit) -> float:
        """Minus twice the logarithm of the evidence, up to a constant."""
        price = sum(
            len(t.strengths()) * math.log(found.problem.samples)
            for t in self.terms
            if t.name in subset.names
        )
        if not subset.functions:
            return found.cost + price
        heat = heat_of(found)
        bare = filled(subset.problem, subset.functions, prior=False)
        free = self.free(bare, subset)
        blocks = blocks_of(bare, found.point, names=free)
        names = [n for f in subset.functions for n in coefficients_of(bare, f.slot)]
        information, _ = unscaled(blocks, names, heat)
        own, rows = blocks.rows(names), blocks.rows(free)

        def first(one: Free) -> int:
            return int(blocks.rows(coefficients_of(bare, one.slot))[0])

        ordered = sorted(subset.functions, key=first)
        spread = np.concatenate([spread_of(f.family, f.roughness) for f in ordered])
        return (
            found.cost
            + price
            + occam(information, rows, own, spread, self.policy.alike)
        )


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
        a.roughness.length == b.roughness.length
        and abs(math.log(a.roughness.size / b.roughness.size)) < 1.0
        for a, b in zip(fresh, functions)
    )
