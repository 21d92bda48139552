"""When a fit is given up: it crawls far from the data, or is late.

Without the right term a fit may find no end of small steps, in a valley that leads
nowhere; the right one needs a few large ones.
"""

import math
from collections.abc import Callable, Sequence


#: cost a sample, one where nothing but noise is left, of a fit that explains the data
EXPLAINED = 1.2
# A fit that explains little crawls, where so many steps took so many attempts or more
# and gained less than this part of what is left to explain
_STEPS, _ATTEMPTS, _CRAWL = 2, 4, 0.01
# and is late, where after so many attempts it costs more than what it is to beat
_LATE = 8


def given_up(
    samples: int, beaten: float = math.inf, decides: float = -math.inf
) -> Callable[[Sequence[float]], bool]:
    """What tells `jaxcam.fitting.fit` to stop.

    **Arguments:** the number of samples; the cost that a fit has to beat before it is
    late; and one below which it is not given up for crawling, as its value decides
    something.
    """

    def stop(costs: Sequence[float]) -> bool:
        late = len(costs) > _LATE and costs[-1] > beaten
        return late or (costs[-1] > decides and crawls(costs, samples))

    return stop


def crawls(costs: Sequence[float], samples: int) -> bool:
    """Whether a fit explains so little, and so slowly, that it leads nowhere.

    **Arguments:** the cost at the start and after each attempt; the number of samples.
    """
    left = costs[-1] - EXPLAINED * samples
    steps = list(dict.fromkeys(costs))
    if left < 0 or len(steps) <= _STEPS:
        return False
    before = steps[-1 - _STEPS]
    attempts = costs[::-1].index(before)
    return attempts >= _ATTEMPTS and before - costs[-1] < _CRAWL * left
