"""Other functions in the place of those found, by redrawn stretches of the records."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fitting import Fit, residuals
from ..policy import Policy
from ..search import Missing


class Rival(NamedTuple):
    """Functions and terms that were fitted in the place of what was chosen.

    - `worse`: score less that of the choice.
    - `share`: of the redrawn sets of stretches in which it would have been chosen; of a
      BIC-like score, an estimate of its posterior probability.
    """

    missing: Missing
    worse: float
    share: float


def rivals(
    found: Missing, tried: Sequence[Missing], policy: Policy, seed: int
) -> tuple[Rival, ...]:
    """The best of what else was fitted, the best first.

    What is fitted stays as it is; what each stretch costs is drawn again, by the same
    draws for all. Something with a part of what was chosen is no rival, unless it is as
    good.
    """
    ranked = sorted(
        (one for one in tried if one is not found), key=lambda one: one.score
    )
    kept: list[Missing] = []
    for one in ranked:
        if _parts(one) != _parts(found) and all(
            _parts(one) != _parts(other) for other in kept
        ):
            kept.append(one)
    kept = kept[: policy.alternatives]
    costs = [_costs(one.fit, policy) for one in (found, *kept)]
    prices = np.array([one.score - one.fit.cost for one in (found, *kept)])
    rng = np.random.default_rng(seed)
    number = costs[0].size
    chosen = np.zeros(len(costs))
    for _ in range(policy.bootstrap):
        weight = np.bincount(rng.integers(0, number, number), minlength=number)
        chosen[int(np.argmin([weight @ one for one in costs] + prices))] += 1
    return tuple(
        Rival(one, one.score - found.score, float(share))
        for one, share in zip(kept, chosen[1:] / policy.bootstrap)
    )


def _parts(one: Missing) -> frozenset[str]:
    """What was fitted, as a set of names."""
    forms = {
        f"{part.label}: {getattr(getattr(part, 'primitive', None), 'name', '')}"
        for part in one.functions
    }
    return one.names | forms


def _costs(found: Fit, policy: Policy) -> Float[np.ndarray, " b"]:
    """The part of a cost that the samples of each stretch of each record have."""
    longest = max(part.recording.time[-1] for part in found.problem.segments)
    edges = np.linspace(0.0, longest, policy.stretches + 1)[1:-1]
    rows = {name: k for k, name in enumerate(found.problem.records)}
    costs = np.zeros((len(rows), policy.stretches))
    for part in residuals(found):
        place = np.searchsorted(edges, part.time)
        np.add.at(costs[rows[part.record]], place, (part.value / part.noise) ** 2)
    return costs.ravel()
