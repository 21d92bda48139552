"""Assess a named term by a block bootstrap of the recordings."""

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
    """Return the part of a subset that does not depend on a few blocks of the
    recordings.

    Terms whose strengths might be zero are dropped first, then the term that the fewest
    bootstrap samples need.

    **Returns:** the fit, the two results of `redrawn` for this fit, and the dropped
    terms with the fraction of the bootstrap samples that would have retained them.
    """
    doubtful: list[tuple[str, float]] = []
    while True:
        inclusion, deviation = redrawn(trials, best, seed)
        sizes = {name: _size(trials, best, name, deviation) for name in inclusion}
        least = min(
            sizes, key=lambda n: (min(sizes[n], 1.0), inclusion[n]), default=None
        )
        if least is None or (
            sizes[least] >= 1 and inclusion[least] >= trials.policy.confidence
        ):
            return best, inclusion, deviation, doubtful
        doubtful.append((least, inclusion[least]))
        best = trials.without(best, least)


def _size(trials: Trials, best: Trial, name: str, deviation) -> float:
    """Return the sum of the squared strengths of a term, in units of their standard
    errors, divided by the critical value; if below one, the strengths may be zero.
    """
    own = [one.name for one in trials.term(name).strengths() if not one.inner]
    found = [best.fit[one] for one in own]
    errors = [max(one.stderr, deviation[one.name]) for one in found]
    size = sum((one.value / error) ** 2 for one, error in zip(found, errors))
    return float(size / chi2.isf(trials.policy.false_alarms, len(own)))


class Needs(NamedTuple):
    """Whether the parts of a model are needed, in the bootstrap samples and in all
    data.

    - `inclusion`: fraction of the bootstrap samples that would retain a part.
    - `deviation`: standard deviation of each free parameter over the bootstrap samples,
      zero for one that has a value for each recording.
    - `lost`: predicted increase in the cost of all data if a part is removed, minus the
      penalty for its parameters. `worse`: the same, without the penalty.
    """

    inclusion: dict[str, float]
    deviation: dict[str, float]
    lost: dict[str, float]
    worse: dict[str, float]


def redrawn(
    trials: Trials, best: Trial, seed: int = 0
) -> tuple[dict[str, float], dict[str, float]]:
    """Run the block bootstrap for the terms of a fit.

    **Returns:** for each term, the fraction of the bootstrap samples that would retain
    it, because a fit without it has a larger BIC; and the standard deviation of each
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
    """Run the block bootstrap for given parts of a model.

    **Arguments:** the problem and a fit; the parameters of each part, and the gain
    required to retain it; the policy, a seed, and the parameters to assess (default:
    all).
    """
    # a joint between two blocks belongs to neither of them, so blocks must be long
    pieces = max(len(flown) for flown, _ in problem.spans)
    slices = min(policy.stretches, max(1, pieces // policy.stretch_pieces))
    blocks = blocks_of(problem, found.point, slices, names)
    free = blocks.rows(_inside(found))
    value = values_of(found, blocks)
    rng = np.random.default_rng(seed)
    rows = {name: blocks.rows(parameters) for name, parameters in own.items()}

    def lost(weight) -> tuple[np.ndarray, dict[str, float]]:
        quadratic = blocks.total(weight)
        step, _ = newton_step(*quadratic, free)
        top = gain(*quadratic, free)
        return step, {
            name: lost_without(*quadratic, value, free, gone, top) - prices[name]
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
    for k, s in zip(free, spread):
        # a sample may lack the recording that determines a value of its own
        if not problem.parameter(blocks.names[k]).per_record:
            deviation[blocks.names[k]] = float(s)
    shares = {name: k / policy.bootstrap for name, k in kept.items()}
    net = lost(None)[1]
    worse = {name: net[name] + prices[name] for name in net}
    return Needs(shares, deviation, net, worse)


def _inside(found: Fit) -> list[str]:
    """Return the free parameters except those at a bound, which are held there."""
    values = np.asarray(found.point.values)
    kept = []
    for name in found.free:
        parameter = found.problem.parameter(name)
        column = values[:, found.problem.names.index(name)]
        if np.all((column > parameter.lower) & (column < parameter.upper)):
            kept.append(name)
    return kept


def lost_without(information, score, value, free, gone, top: float) -> float:
    """Return the increase in the cost when some strengths are zero and all other
    parameters are refitted.
    """
    step = np.zeros(len(value))
    step[gone] = -value[gone]
    lost = step @ information @ step - 2 * step @ score
    moved = score - information @ step
    return top + lost - gain(information, moved, np.setdiff1d(free, gone))
