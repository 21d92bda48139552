"""Stop a fit that is too slow, or that makes little progress while its cost is high.

Without the right term, a fit may take very many small steps along a valley of the cost;
with the right term, it needs a few large steps.
"""

import math
from collections.abc import Callable, Sequence

from ..policy import Policy


# Factor by which a successful step usually reduces a cost that is far too high
_A_STEP = 10.0


def given_up(
    samples: int,
    policy: Policy,
    beaten: float = math.inf,
    decides: float = -math.inf,
) -> Callable[[Sequence[float]], bool]:
    """Return a callback that tells `jaxcam.fitting.fit` when to stop.

    A fit is late if its cost is still above a given value after a number of attempts,
    or, after half that number, so far above it that it cannot fall below it in time. It
    crawls if it explains little and its last steps took many attempts and gained
    very little.

    **Arguments:** the number of samples; the policy; the cost that a fit must fall
    below; and the cost below which a crawling fit is not stopped, because its final
    cost affects a decision.
    """

    def stop(costs: Sequence[float]) -> bool:
        late = falls_late(costs, beaten, policy)
        return late or (costs[-1] > decides and crawls(costs, samples, policy))

    return stop


def falls_late(costs: Sequence[float], beaten: float, policy: Policy) -> bool:
    """Return whether a fit is late: it will not fall below the cost `beaten` in the
    allowed number of attempts.

    **Arguments:** the costs at the start and after each attempt; the cost; the policy.
    """
    left = policy.late_attempts + 1 - len(costs)
    if 2 * left > policy.late_attempts:
        return False
    return costs[-1] > beaten * _A_STEP ** max(left, 0)


def crawls(costs: Sequence[float], samples: int, policy: Policy) -> bool:
    """Return whether a fit crawls: it explains little and gains very slowly.

    **Arguments:** the costs at the start and after each attempt; the number of samples;
    the policy.
    """
    left = costs[-1] - policy.explained * samples
    steps = list(dict.fromkeys(costs))
    if left < 0 or len(steps) <= policy.crawl_steps:
        return False
    before = steps[-1 - policy.crawl_steps]
    attempts = costs[::-1].index(before)
    return (
        attempts >= policy.crawl_attempts
        and before - costs[-1] < policy.crawl_gain * left
    )
