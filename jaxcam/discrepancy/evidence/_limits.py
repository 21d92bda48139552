"""Detection limits: the smallest strength at which each term would be named."""

import math
from typing import NamedTuple

import numpy as np

from ..search import newton_step, Trial, Trials


class Limit(NamedTuple):
    """The smallest strength that would be named, its standard error and its unit.

    `hidden` is the rig parameter that would absorb most of the effect, and `confusion`
    the ratio of the standard error to that for known values of all other parameters.
    """

    size: float
    stderr: float
    unit: str
    hidden: str
    confusion: float


def limits(trials: Trials, trial: Trial) -> dict[str, Limit]:
    """Return the smallest strength at which each term would be named in addition to
    those of a trial.

    **Returns:** limits by the name of the parameter.
    """
    blocks = trials.blocks(trial)
    information, score = blocks.total()
    free = blocks.rows(trials.parameters(trial.names))
    rig = blocks.rows(trials.rig)
    found = {}
    for term in trials.terms:
        # skip a term with an inner parameter, on which its limit would depend
        if term.name in trial.names or term.starts():
            continue
        for one in term.strengths():
            if one.inner:
                continue
            row = blocks.rows([one.name])
            rows = np.union1d(free, row)
            _, covariance = newton_step(information, score, rows)
            place = np.searchsorted(rows, row[0])
            stderr = math.sqrt(abs(covariance[place, place]))
            # without the term, the rig parameters shift by the projection of the term
            # on them
            across = np.zeros(len(blocks.names))
            across[rig] = information[rig, row[0]]
            taken, spread = newton_step(information, across, rig)
            own = np.sqrt(np.diag(spread))
            hidden = ""
            if len(rig):
                hidden = blocks.names[rig[int(np.argmax(np.abs(taken) / own))]]
            size = stderr * float(blocks.scale[row[0]])
            threshold = math.sqrt(trials.threshold(term.name)) + trials.policy.beyond
            alone = information[row[0], row[0]]
            confusion = stderr * math.sqrt(alone) if alone > 0 else math.inf
            found[one.name] = Limit(size * threshold, size, one.unit, hidden, confusion)
    return found
