"""How sure a named term is: the bootstrap of blocks of the records."""

import math

import numpy as np
from scipy.stats import chi2

from ...fitting import Fit
from ..search import blocks_of, gain, newton_step, Trial, Trials, values_of


def sure(
    trials: Trials, best: Trial, seed: int = 0
) -> tuple[Trial, dict[str, float], dict[str, float], list[tuple[str, float]]]:
    """The part of a subset that does not hang on a few stretches of the records.

    A term whose strength might be zero is dropped first, then the one that fewest of
    the redrawn sets need.

    **Returns:** the fit, what `redrawn` says of it, and the terms that were dropped
    with the part of the redrawn sets that would have kept them.
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


def redrawn(
    trials: Trials, best: Trial, seed: int = 0
) -> tuple[dict[str, float], dict[str, float]]:
    """Draw stretches of the records again, a second or so each.

    **Returns:** of each term, in which part of the redrawn sets it would be kept,
    because a fit without it is worse by BIC; and the standard deviation of each
    parameter.
    """
    problem, policy = trials.problem, trials.policy
    # what ties one stretch to the next is in neither, so they must hold many ties
    pieces = max(len(flown) for flown, _ in problem.spans)
    slices = min(policy.stretches, max(1, pieces // policy.stretch_pieces))
    blocks = blocks_of(problem, best.fit.point, slices)
    free = blocks.rows(_inside(best.fit))
    value = values_of(best.fit, blocks)
    rng = np.random.default_rng(seed)
    kept = dict.fromkeys(sorted(best.names), 0)
    own = {
        name: blocks.rows([one.name for one in trials.term(name).strengths()])
        for name in kept
    }
    estimates = []
    number = len(blocks.record)
    for _ in range(policy.bootstrap):
        weight = np.bincount(rng.integers(0, number, number), minlength=number)
        information, score = blocks.total(weight.astype(float))
        step, _ = newton_step(information, score, free)
        estimates.append((value[free] + step) * blocks.scale[free])
        top = gain(information, score, free)
        for name in kept:
            lost = _lost(information, score, value, free, own[name], top)
            kept[name] += bool(lost > len(own[name]) * math.log(problem.samples))
    spread = np.std(np.array(estimates), axis=0)
    deviation = dict.fromkeys(best.fit.free, 0.0)
    deviation |= {blocks.names[k]: float(s) for k, s in zip(free, spread)}
    return {name: k / policy.bootstrap for name, k in kept.items()}, deviation


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
    """What is lost where some strengths are zero and all else is fitted again."""
    step = np.zeros(len(value))
    step[gone] = -value[gone]
    lost = step @ information @ step - 2 * step @ score
    moved = score - information @ step
    return top + lost - gain(information, moved, np.setdiff1d(free, gone))
