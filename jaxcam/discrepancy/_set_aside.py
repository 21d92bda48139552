"""Find and exclude a recording that is inconsistent with the others.

Physics common to all recordings cannot explain a single misread recording (wrong gain,
rig or unit). If it is not excluded, this recording hides physics missing in the others.
"""

import dataclasses

import numpy as np

from ..fitting import Fit, Problem
from .policy import Policy
from .report import Caveat, Diagnosis, Reason, Verdict


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


def elsewhere(problem: Problem, name: str, policy: Policy) -> bool:
    """Return whether a recording visits states that no other recording visits.

    Missing physics may then act in this recording only. At least a fraction
    `policy.odd_share` of the samples of one of its channels must lie outside the range
    of this channel in the other recordings.
    """
    runs = [part.recording for part in problem.segments]
    (odd,) = [run for run in runs if run.name == name]
    others = [run for run in runs if run is not odd]
    for channel in problem.model.sensors:
        if channel not in odd.channels:
            continue
        known = [run[channel] for run in others if channel in run.channels]
        if not known:
            continue
        seen, its = np.concatenate(known), odd[channel]
        outside = (its < np.nanmin(seen)) | (its > np.nanmax(seen))
        if np.mean(outside) >= policy.odd_share:
            return True
    return False


def set_aside(found: Diagnosis, again: Diagnosis, name: str) -> Diagnosis:
    """Return the diagnosis of the other recordings, if it explains them better.

    If nothing is missing in the others, physics may be missing in states that only the
    inconsistent recording visits; the diagnosis of all recordings is then returned.

    **Arguments:** the diagnosis of all recordings, the one without the inconsistent
    recording, and its name.
    """
    costs = cost_by_record(found.after)
    better = (
        max(cost_by_record(again.after).values()) < costs[name] / found.policy.odd_ratio
    )
    there = elsewhere(found.after.problem, name, found.policy)
    if there and again.verdict is Verdict.NONE:
        better = False
    chosen = again if better else found
    done = "is excluded" if better else "is not explained by any of the terms tried"
    sentence = (
        f"The recording {name} {done}: with the model fitted to all recordings, its "
        f"residual is {np.sqrt(costs[name]):.3g} times the noise, whereas that of "
        "every other recording is at most "
        f"{np.sqrt(sorted(costs.values())[-2]):.3g} times the noise. Check how "
        f"{name} was recorded and read."
    )
    if there:
        sentence += (
            f" Parts of {name} are outside the range of the other recordings; physics "
            "may be missing that acts only there."
        )
    caveat = Caveat(Reason.SET_ASIDE, sentence)
    return dataclasses.replace(chosen, caveats=(caveat, *chosen.caveats))
