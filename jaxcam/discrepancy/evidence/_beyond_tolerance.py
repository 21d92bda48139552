"""Find parameters whose fitted values are outside their stated tolerances.

A value outside the tolerance indicates an effect that acts like the parameter, or an
error in the rig file.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from ...fitting.engine import invert_information, nominal_of
from ..search import Trial, Trials


class Beyond(NamedTuple):
    """A parameter outside its tolerance.

    - `value`, `stderr`, `unit`: result of the fit; `low`, `high`: ends of the
      tolerance.
    - `excess`: distance beyond the nearer end, positive.
    - `chance`: fraction of the bootstrap distribution beyond that end.
    """

    name: str
    value: float
    stderr: float
    unit: str
    low: float
    high: float
    excess: float
    chance: float


def beyond_tolerance(trials: Trials, best: Trial, deviation) -> list[Beyond]:
    """Return the rig parameters that are significantly outside their tolerances, the
    furthest first.

    **Arguments:** the fit with the named terms, and the standard deviations of its
    parameters over the bootstrap samples, by name.
    """
    found = []
    for name in trials.rig:
        parameter = trials.problem.parameter(name)
        if not math.isfinite(parameter.tolerance) or parameter.per_record:
            continue
        nominal = nominal_of(trials.problem, trials.problem.names.index(name))
        one = best.fit[name]
        stderr = max(one.stderr, deviation.get(name, 0.0))
        low, high = nominal - parameter.tolerance, nominal + parameter.tolerance
        excess = max(one.value - high, low - one.value)
        level = norm.isf(trials.policy.false_alarms / (2 * len(trials.rig)))
        if math.isfinite(stderr) and excess > level * stderr:
            chance = float(norm.cdf(excess / max(stderr, 1e-300)))
            found.append(
                Beyond(name, one.value, stderr, one.unit, low, high, excess, chance)
            )
    return sorted(found, key=lambda one: -one.excess / one.stderr)


def acting_alike(trials: Trials, best: Trial, name: str) -> Iterator[str]:
    """Yield the terms that the data cannot distinguish from a parameter of the rig.

    A term is indistinguishable if almost none of the information on its strength
    remains when that parameter is free, although most of it remains when all other
    parameters are free.
    """
    blocks = trials.blocks(best)
    information = np.sum(blocks.information, axis=0)
    free = blocks.rows(trials.parameters(best.names))
    own = blocks.rows([name])
    others = np.setdiff1d(free, own)
    for term in trials.terms:
        strengths = term.strengths()
        if term.name in best.names or len(strengths) != 1 or strengths[0].inner:
            continue
        row = int(blocks.rows([strengths[0].name])[0])
        alone = _left(information, row, others)
        if alone > trials.policy.half_information * information[row, row]:
            beside = _left(information, row, free)
            if beside < trials.policy.half_information * alone:
                yield term.name


def _left(information, row: int, free) -> float:
    """Return the information that is left on one parameter when others are free."""
    free = free[np.diag(information)[free] > 0]
    inside = invert_information(information[np.ix_(free, free)])
    across = information[row, free]
    return float(information[row, row] - across @ inside @ across)
