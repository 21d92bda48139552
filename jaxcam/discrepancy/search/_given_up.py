"""Stop a fit early: it makes little progress far from the data, or is late.

Without the right term a fit may find no end of small steps, in a valley that leads
nowhere; the right one needs a few large ones.
"""

import math
from collections.abc import Callable, Sequence

from ..policy import Policy


def given_up(
    samples: int,
    policy: Policy,
    beaten: float = math.inf,
    decides: float = -math.inf,
) -> Callable[[Sequence[float]], bool]:
    """Return the callback that tells `jaxcam.fitting.fit` to stop.

    A fit is late where it has not beaten a cost after so many attempts; it crawls where
    it explains little and its last steps took many attempts and gained next to nothing.

    **Arguments:** the number of samples; the policy; the cost that a fit has to beat;
    and one below which it is not given up for crawling, as its value decides something.
    """

    def stop(costs: Sequence[float]) -> bool:
        late = len(costs) > policy.late and costs[-1] > beaten
        return late or (costs[-1] > decides and crawls(costs, samples, policy))

    return stop


def crawls(costs: Sequence[float], samples: int, policy: Policy) -> bool:
    """Whether a fit explains so little, and so slowly, that it leads nowhere.

    **Arguments:** the cost at the start and after each attempt; the number of samples.
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
