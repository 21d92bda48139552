"""Shares of the misfit, for each effect and for each part of the motion."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from ...fitting import Fit
from ...fitting.engine import FLIGHT, IMPACT
from ..policy import Policy


class Shares(NamedTuple):
    """Shares of the misfit of the textbook model; their sum is one.

    - `of`: the fraction of each named term or function, by label.
    - `left`: the unexplained share.
    """

    of: dict[str, float]
    left: float


def shares(
    before: Fit,
    after: Fit,
    lost: Mapping[str, float],
    left: float,
    policy: Policy = Policy(),
) -> Shares:
    """Divide the misfit of a model among the effects that explain it.

    The part explained by all effects together is the reduction of the cost from
    `before` to `after`; it is divided in proportion to the loss when each of them is
    removed.

    **Arguments:** fits without and with the effects; the increase in the cost without
    each effect; the gain of a further function (0 if no structure remains); the policy.
    """
    samples = after.problem.samples
    surplus = after.cost - samples - policy.cost_errors * math.sqrt(2 * samples)
    left = max(left, surplus, 0.0)
    explained = max(before.cost - after.cost, 0.0)
    whole = explained + left
    if not whole > 0 or not math.isfinite(whole):
        return Shares(dict.fromkeys(lost, 0.0), 0.0)
    weights = {name: max(value, 0.0) for name, value in lost.items()}
    total = sum(weights.values())
    if not total > 0:
        weights, total = dict.fromkeys(lost, 1.0), float(max(len(lost), 1))
    part = explained / whole
    return Shares(
        {name: part * value / total for name, value in weights.items()},
        left / whole if lost else 1.0,
    )


def misfit_by_part(found: Fit, policy: Policy = Policy()) -> dict[str, float]:
    """Return the fractions of a misfit in flights, impacts and contacts, by name.

    The misfit of a part is its cost in excess of that of noise: one per sample, and one
    per component of a joint. The result is empty if no part has a significant misfit.
    """
    pieces, costs = found.problem.pieces, found.costs
    exists = np.asarray(pieces.exists)
    joint, joints = np.asarray(pieces.joint), np.asarray(costs.joints)
    size = found.problem.start.states.shape[-1]
    inside, met = exists & (joint == FLIGHT), exists & (joint == IMPACT)
    flown = int(np.sum(np.asarray(pieces.flown.known)))
    rested = int(np.sum(np.asarray(pieces.rested.known)))
    # the fitted state of a piece absorbs as many samples as it has components
    parts = {
        "flight": (
            float(np.sum(np.asarray(costs.flown)[exists]) + np.sum(joints[inside])),
            flown - size * int(np.sum(exists & ~inside)),
        ),
        "impact": (float(np.sum(joints[met])), (size + 1) * int(np.sum(met))),
        "contact": (float(np.nansum(np.asarray(costs.rested))), rested),
    }
    excess = {
        name: cost - number
        for name, (cost, number) in parts.items()
        if number > 0 and cost - number > policy.cost_errors * math.sqrt(2 * number)
    }
    total = sum(excess.values())
    return {name: value / total for name, value in excess.items()} if excess else {}
