"""Leave several redundant supports at once."""

import jax.numpy as jnp

from ..surface import FEW
from ._flight import StepVerdict
from ._functions import Functions
from ._landing import Landing
from ._select import largest


# a rate of a multiplier below this fraction of the largest one may be rounding
_RISES = 1e-6
# a multiplier below this fraction of the largest one has reached zero
_AT_ZERO = 1e-9


def leave_together(
    functions: Functions, landing: Landing, held: StepVerdict, released, delay
) -> list:
    """Return for each constraint whether the body leaves it at the end of a step.

    A body on redundant supports leaves several of them at once, when it begins to tip
    about the others. The multipliers of these supports reach zero together.

    **Arguments:** the end of the step; its verdict on the contacts; whether a
    constraint is `released`; and the time (s) from the end of the step to the release.
    """
    went = [released & (held.constraint == k) for k in range(functions.m)]
    if functions.m < FEW:
        return went
    pairs = list(zip(landing.jets[: functions.m], landing.mode, strict=False))
    pulls = [jnp.where(c, jet.acceleration + delay * jet.jerk, 0.0) for jet, c in pairs]
    least = _AT_ZERO * largest([jnp.abs(pull) for pull in pulls])
    rate = _RISES * largest([jnp.where(c, jet.jerk, 0.0) for jet, c in pairs])
    return [
        one | (released & c & (jet.jerk > rate) & (jnp.abs(pull) <= least))
        for one, (jet, c), pull in zip(went, pairs, pulls, strict=True)
    ]
