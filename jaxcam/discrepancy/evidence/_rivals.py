"""Compare other functions with those found, by a block bootstrap."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...fitting import Fit
from ..policy import Policy
from ..search import Missing


class Rival(NamedTuple):
    """Functions and terms that were fitted in place of the chosen ones.

    - `worse`: score minus that of the choice.
    - `share`: fraction of the bootstrap samples in which they would have been chosen.
      The score corresponds to a BIC, so the fraction estimates their posterior
      probability.
    """

    missing: Missing
    worse: float
    share: float


def rivals(
    found: Missing, tried: Sequence[Missing], policy: Policy, seed: int
) -> tuple[Rival, ...]:
    """Return the best of the other fits, in order of their scores, with one fit for
    each combination of functions and terms.

    The block bootstrap draws the same blocks of the recordings for all fits. No fit is
    repeated: each bootstrap sample weights the costs of the blocks.
    """
    ranked = sorted(
        (one for one in tried if one is not found), key=lambda one: one.score
    )
    kept: list[Missing] = []
    for one in ranked:
        # the choice with an additional part is no alternative: that part was left out
        nested = _parts(found) <= _parts(one)
        # a function whose parts were named is no alternative to them
        nested |= _parts(one) < _parts(found) and one.score < found.score
        if not nested and all(_parts(one) != _parts(other) for other in kept):
            kept.append(one)
    kept = kept[: policy.alternatives]
    costs = [_costs(one.fit, policy) for one in (found, *kept)]
    # joints, priors and penalties for parameters are not resampled
    prices = np.array(
        [one.score - cost.sum() for one, cost in zip((found, *kept), costs)]
    )
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
    """Return the names of the terms, functions and forms in a fit."""
    forms = {f"{part.label}: {getattr(part, 'form', '')}" for part in one.functions}
    return one.names | forms


def _costs(found: Fit, policy: Policy) -> Float[np.ndarray, " b"]:
    """Return the cost of the samples of each section of each recording; a piece belongs
    to the section in which it begins.
    """
    problem, costs = found.problem, found.costs
    longest = max(part.recording.duration for part in problem.segments)
    edges = np.linspace(0.0, longest, policy.stretches + 1)[1:-1]
    totals = np.zeros((len(problem.records), policy.stretches))
    for part, each in (
        (problem.pieces.flown, costs.flown),
        (problem.pieces.rested, costs.rested),
    ):
        begun = np.asarray(part.start) - problem.begun[:, None]
        rows = np.arange(len(totals))[:, None]
        # a contact whose surface is not found gives no information
        np.add.at(totals, (rows, np.searchsorted(edges, begun)), np.nan_to_num(each))
    return totals.ravel()
