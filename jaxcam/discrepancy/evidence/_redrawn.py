"""Assess a named term by a block bootstrap of the records."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.stats import chi2

from ...fitting import Fit, Problem
from ..policy import Policy
from ..search import blocks_of, gain, newton_step, Trial, Trials, values_of


def sure(
    trials: Trials, best: Trial, seed: int = 0
) -> tuple[Trial, dict[str, float], dict[str, float], list[tuple[str, float]]]:
    """The part of a subset that does not hang on a few stretches of the records.

    A term whose strength might be zero is dropped first, then the one that fewest of
    the bootstrap samples need.

    **Returns:** the fit, what `redrawn` says of it, and the terms that were dropped
    with the part of the bootstrap samples that would have kept them.
    """
    doubtful: list[tuple[str, float]] = []
    while True:
        inclusion, deviation = redrawn(trials, best, seed)
        sizes = {name: _size(trials, best, name, deviation) for name in inclusion}
        least = min(
            sizes, key=lambda n: (min(sizes[n], 1.0), inclusion[n]), default=None
        )
        if least is None or (
            sizes[least] >= 1 and inclusion[least] >= trials.policy.sure
        ):
            return best, inclusion, deviation, doubtful
        doubtful.append((least, inclusion[least]))
        best = trials.without(best, least)


def _size(trials: Trials, best: Trial, name: str, deviation) -> float:
    """Strengths of a term beside what redrawing does to them; below one, maybe zero."""
    own = [one.name for one in trials.term(name).strengths() if not one.inner]
    found = [best.fit[one] for one in own]
    errors = [max(one.stderr, deviation[one.name]) for one in found]
    size = sum((one.value / error) ** 2 for one, error in zip(found, errors))
    return float(size / chi2.isf(trials.policy.false_alarms, len(own)))


class Needs(NamedTuple):
    """The parts of a model that are needed, by the bootstrap samples and by all data.

    - `inclusion`: share of the bootstrap samples that would keep a part.
    - `deviation`: of each free parameter, over the bootstrap samples.
    - `lost`: what all data lose without a part, less its price.
    """

    inclusion: dict[str, float]
    deviation: dict[str, float]
    lost: dict[str, float]


def redrawn(
    trials: Trials, best: Trial, seed: int = 0
) -> tuple[dict[str, float], dict[str, float]]:
    """Draw stretches of the records again, a second or so each.

    **Returns:** of each term, in which part of the bootstrap samples it would be kept,
    because a fit without it is worse by BIC; and the standard deviation of each
    parameter.
    """
    own = {
        name: [one.name for one in trials.term(name).strengths()]
        for name in sorted(best.names)
    }
    price = math.log(trials.problem.samples)
    prices = {name: len(names) * price for name, names in own.items()}
    found = needs(trials.problem, best.fit, own, prices, trials.policy, seed)
    return found.inclusion, found.deviation


def needs(
    problem: Problem,
    found: Fit,
    own: Mapping[str, Sequence[str]],
    prices: Mapping[str, float],
    policy: Policy,
    seed: int = 0,
    names: Sequence[str] | None = None,
) -> Needs:
    """Draw stretches of the records again, and see which parts they need.

    **Arguments:** the problem and a fit; the parameters of each part, and what a part
    must gain to be kept; the policy, a seed, and the parameters to look at (all).
    """
    # what ties one stretch to the next is in neither, so they must hold many ties
    pieces = max(len(flown) for flown, _ in problem.spans)
    slices = min(policy.stretches, max(1, pieces // policy.stretch_pieces))
    blocks = blocks_of(problem, found.point, slices, names)
    free = blocks.rows(_inside(found))
    value = values_of(found, blocks)
    rng = np.random.default_rng(seed)
    rows = {name: blocks.rows(parameters) for name, parameters in own.items()}

    def lost(weight) -> tuple[np.ndarray, dict[str, float]]:
        information, score = blocks.total(weight)
        step, _ = newton_step(information, score, free)
        top = gain(information, score, free)
        return step, {
            name: _lost(information, score, value, free, gone, top) - prices[name]
            for name, gone in rows.items()
        }

    estimates, kept = [], dict.fromkeys(own, 0)
    number = len(blocks.record)
    for _ in range(policy.bootstrap):
        weight = np.bincount(rng.integers(0, number, number), minlength=number)
        step, left = lost(weight.astype(float))
        estimates.append((value[free] + step) * blocks.scale[free])
        for name in kept:
            kept[name] += bool(left[name] > 0)
    spread = np.std(np.array(estimates), axis=0)
    deviation = dict.fromkeys(found.free, 0.0)
    deviation |= {blocks.names[k]: float(s) for k, s in zip(free, spread)}
    shares = {name: k / policy.bootstrap for name, k in kept.items()}
    return Needs(shares, deviation, lost(None)[1])


def _inside(found: Fit) -> list[str]:
    """Free parameters but those that press against a bound, where they stay."""
    values = np.asarray(found.point.values)
    kept = []
    for name in found.free:
        parameter = found.problem.parameter(name)
        column = values[:, found.problem.names.index(name)]
        if np.all((column > parameter.lower) & (column < parameter.upper)):
            kept.append(name)
    return kept


def _lost(information, score, value, free, gone, top: float) -> float:
    """Return the loss when some strengths are zero and all else is fitted again."""
    step = np.zeros(len(value))
    step[gone] = -value[gone]
    lost = step @ information @ step - 2 * step @ score
    moved = score - information @ step
    return top + lost - gain(information, moved, np.setdiff1d(free, gone))
