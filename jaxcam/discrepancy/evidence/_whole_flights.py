"""The residual over complete flights, of a fit that allows for model errors."""

import dataclasses
from typing import NamedTuple

import numpy as np

from ...fitting import Fit, fit, residuals
from ...fitting.engine import allowing, JOINT
from ..policy import Policy
from ..search import given_up
from ..terms import watching


# Errors of the joints in successive fits, relative to those of a single piece
_PARTS = (0.1, 0.01, JOINT)


class WholeFlights(NamedTuple):
    """Rms residuals over complete flights in the main channel, in its unit, without
    (`before`) and with (`after`) what was found.
    """

    before: float
    after: float


def whole_flights(
    before: Fit, after: Fit, looseness: float, policy: Policy
) -> WholeFlights:
    """Fit the chosen model to complete flights, starting from its fit to single pieces.

    **Arguments:** the fit of the textbook model to complete flights; the fit of the
    chosen model, in which the pieces may join inexactly; the error of its joints
    relative to that of a single piece; the policy.
    """
    found = after
    for part in _PARTS:
        # all joints at once would start with too poor a fit; the scale of looser
        # joints than those of separate pieces is that of the joints themselves
        tight = allowing(after.problem.extras, part / max(looseness, 1.0))
        found = fit(
            dataclasses.replace(after.problem, extras=tight),
            free=after.free,
            start=found.point,
            iterations=policy.quick_iterations,
            stop=given_up(after.problem.samples, policy),
        )
    return WholeFlights(_rms(before), _rms(found))


def _rms(found: Fit) -> float:
    main = watching(found.problem.model)
    parts = [one.value for one in residuals(found) if one.channel == main]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))
