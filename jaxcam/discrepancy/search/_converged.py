"""Judge whether repeated fits of functions and elements have converged."""

import math
from collections.abc import Sequence

from ..policy import Policy
from ._hidden_state import Hidden
from ._slots import Part


# Change, as a fraction of the allowed step, below which element parameters have
# converged
_SETTLED = 0.02
# Change, as a fraction of the allowed step, from which element parameters are still far
# from their optimum
_REACHING = 0.5
# Number of successive fits that hardly improve, after which a poor one is given up
_SLOW = 3


def alike(fresh: Sequence[Part], functions: Sequence[Part]) -> bool:
    """Return whether the smoothness of functions and the parameters of elements have
    converged.
    """
    return all(_as_before(a, b) for a, b in zip(fresh, functions))


def stuck(
    costs: Sequence[float],
    fresh: Sequence[Part],
    functions: Sequence[Part],
    left: int,
    policy: Policy,
) -> bool:
    """Return whether fits with an element remain poor, although its parameters hardly
    change.

    Their costs fall so slowly that they would be poor even after the fits that are
    left.

    **Arguments:** the costs per sample of the fits so far; the functions and elements
    suggested by the last fit, and those of this fit; the number of fits left.
    """
    last = costs[-1 - _SLOW :]
    if len(last) <= _SLOW:
        return False
    rates = [after / before for before, after in zip(last, last[1:])]
    slow = all(
        cost * min(rate, 1.0) ** left > policy.near_cost
        for cost, rate in zip(last[1:], rates)
    )
    return slow and _moved(fresh, functions) < _REACHING


def _moved(fresh: Sequence[Part], functions: Sequence[Part]) -> float:
    """Return the largest change of the parameters of elements, as a fraction of the
    allowed step.
    """
    return max(
        (
            one.moved_from(before)
            for one, before in zip(fresh, functions)
            if isinstance(one, Hidden) and isinstance(before, Hidden)
        ),
        default=0.0,
    )


def _as_before(fresh: Part, one: Part) -> bool:
    if isinstance(fresh, Hidden):
        return isinstance(one, Hidden) and fresh.moved_from(one) < _SETTLED
    if isinstance(one, Hidden):
        return False
    return (
        not fresh.smooth
        or fresh.roughness.length == one.roughness.length
        and abs(math.log(fresh.roughness.size / one.roughness.size)) < 1.0
    )
