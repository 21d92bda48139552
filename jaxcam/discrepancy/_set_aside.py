"""Find and exclude a recording that is inconsistent with the others.

Physics common to all recordings cannot explain a single misread recording (wrong gain,
rig or unit). If it is not excluded, this recording hides physics missing in the others.
If nothing is missing in the others, a recording that visits states of its own is not
excluded, because physics may be missing that acts only there.
"""

import dataclasses

import numpy as np

from ..fitting import Fit, Problem
from ._elsewhere import falls_short
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


def _worst_time(found: Fit, name: str) -> float:
    """Return the time (s) at which the piece of flight of a recording with the largest
    cost begins.
    """
    row, pieces = found.problem.records.index(name), found.problem.pieces
    costs = np.asarray(found.costs.flown)[row] + np.asarray(found.costs.joints)[row]
    costs = np.where(np.asarray(pieces.exists)[row], costs, -np.inf)
    return float(np.asarray(pieces.flown.start)[row, int(np.argmax(costs))])


def visits_own_states(problem: Problem, name: str, policy: Policy) -> bool:
    """Return whether a recording visits states that no other recording visits.

    Missing physics may then act in this recording only. At least a fraction
    `policy.odd_share` of the samples of a channel, the values of a state component at
    the beginnings of the pieces of flight, or the approach speeds must lie outside the
    range of the other recordings, extended at both ends by the same fraction.
    """
    groups = zip(*(_visited(problem, k) for k in range(len(problem.records))))
    number = problem.records.index(name)
    return any(
        _share_outside(
            group[number],
            np.concatenate([*group[:number], *group[number + 1 :]]),
            policy,
        )
        >= policy.odd_share
        for group in groups
    )


def _visited(problem: Problem, k: int) -> list[np.ndarray]:
    """Return the finite values of each channel and state component of a recording, and
    its approach speeds.
    """
    part = problem.segments[k]
    run, used = part.recording, np.ones(len(part.recording.time), dtype=bool)
    if run.filled is not None:
        used &= ~np.asarray(run.filled)
    nothing = np.zeros(0)
    values = [
        run[name][used] if name in run.channels else nothing
        for name in problem.model.sensors
    ]
    exists = np.asarray(problem.pieces.exists)[k]
    values += list(np.asarray(problem.start.states)[k][exists].T)
    values.append(np.asarray(part.impacts.approach))
    return [one[np.isfinite(one)] for one in values]


def _share_outside(own: np.ndarray, others: np.ndarray, policy: Policy) -> float:
    """Return the fraction of values that lie outside the range of others, without its
    tails and extended by a margin.
    """
    if not len(own) or not len(others):
        return 0.0
    tail = policy.velocity_tail
    low, high = np.quantile(others, [tail, 1 - tail])
    margin = policy.odd_share * (high - low)
    return float(np.mean((own < low - margin) | (own > high + margin)))


def not_set_aside(found: Diagnosis, name: str) -> Diagnosis:
    """Return the diagnosis of all recordings with a caveat that its result rests on an
    inconsistent recording; nothing is missing in the others.
    """
    where = "states that no other recording visits"
    if falls_short(found):
        said = f"Either {name} was misread, or unidentified physics acts in {where}."
    else:
        said = f"What is missing acts in {where}, or {name} was misread."
    sentence = (
        f"Without the recording {name}, nothing is missing. {said} Check how {name} "
        "was recorded and read, or record such states again."
    )
    caveat = Caveat(Reason.SET_ASIDE, sentence)
    return dataclasses.replace(found, caveats=(caveat, *found.caveats))


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
        f"{np.sqrt(sorted(costs.values())[-2]):.3g} times the noise. The residual of "
        f"{name} is largest near {_worst_time(found.after, name):.4g} s. Check how "
        f"{name} was recorded and read, and whether an impact or a very low flight was "
        "missed there."
    )
    caveat = Caveat(Reason.SET_ASIDE, sentence)
    return dataclasses.replace(chosen, caveats=(caveat, *chosen.caveats))
