"""Find and exclude a recording that is inconsistent with the others.

Physics common to all recordings cannot explain a single misread recording (wrong gain,
rig or unit). If it is not excluded, this recording hides physics missing in the others.
"""

import dataclasses

import numpy as np

from ..fitting import Fit
from .policy import Policy
from .report import Caveat, Diagnosis, Reason


def odd_record(found: Fit, policy: Policy) -> str | None:
    """Return the name of the only recording that a fit leaves unexplained, if there is
    one.

    There must be at least `policy.records_apart` recordings. The cost per sample of the
    unexplained recording must be at least `policy.near_cost`, and at least
    `policy.odd_ratio` times that of every other recording.
    """
    costs = cost_by_record(found)
    if len(costs) < policy.records_apart:
        return None
    worst, second = sorted(costs.values(), reverse=True)[:2]
    if worst < policy.near_cost or worst < policy.odd_ratio * max(second, 1.0):
        return None
    return max(costs, key=lambda name: costs[name])


def cost_by_record(found: Fit) -> dict[str, float]:
    """Return the cost per sample of each recording; near 1 if only noise remains."""
    problem, costs = found.problem, found.costs
    exists = np.asarray(problem.pieces.exists)
    flown = np.where(exists, np.asarray(costs.flown) + np.asarray(costs.joints), 0.0)
    total = flown.sum(axis=1) + np.nan_to_num(np.asarray(costs.rested)).sum(axis=1)
    known = [
        np.asarray(part.known).reshape(len(problem.records), -1).sum(axis=1)
        for part in (problem.pieces.flown, problem.pieces.rested)
    ]
    samples = np.maximum(known[0] + known[1], 1)
    return dict(zip(problem.records, (total / samples).tolist()))


def set_aside(found: Diagnosis, again: Diagnosis, name: str) -> Diagnosis:
    """Return the diagnosis of the other recordings, if it explains them better.

    **Arguments:** the diagnosis of all recordings, the one without the inconsistent
    recording, and its name.
    """
    costs = cost_by_record(found.after)
    better = (
        max(cost_by_record(again.after).values()) < costs[name] / found.policy.odd_ratio
    )
    chosen = again if better else found
    done = "is excluded" if better else "is not explained by any of the terms tried"
    sentence = (
        f"The recording {name} {done}: with the model fitted to all recordings, its "
        f"residual is {np.sqrt(costs[name]):.3g} times the noise, whereas that of "
        "every other recording is at most "
        f"{np.sqrt(sorted(costs.values())[-2]):.3g} times the noise. Check how "
        f"{name} was recorded and read."
    )
    caveat = Caveat(Reason.SET_ASIDE, sentence)
    return dataclasses.replace(chosen, caveats=(caveat, *chosen.caveats))
