"""Caveats about the stated noise of the channels."""

from collections.abc import Iterator

import numpy as np

from ...fitting import Fit, residuals
from ..policy import Policy
from ..search import Question
from ._caveat import Caveat, Reason
from ._words import ratio


def noisier_than_stated(question: Question) -> Iterator[Caveat]:
    """Return caveats for channels whose stated noise is too small."""
    for one in question.noisier:
        yield Caveat(
            Reason.NOISIER,
            f"The measured noise of `{one.channel}` is {one.seen:.3g}, "
            f"{ratio(one.seen / one.stated)} times the stated noise "
            f"({one.stated:.3g}); "
            "the larger value was used.",
        )


def quieter_than_stated(
    question: Question, found: Fit, policy: Policy
) -> Iterator[Caveat]:
    """Return caveats for channels whose stated noise is too large.

    The noise is not replaced, because slow errors of a sensor may be absorbed by the
    fit.
    """
    if question.model_errors:
        # the noise was increased
        return
    every = residuals(found)
    for channel in found.problem.model.sensors:
        parts = [one for one in every if one.channel == channel and len(one.value)]
        if not parts:
            continue
        noise = parts[0].noise
        left = float(np.sqrt(np.mean([one.rms**2 for one in parts])))
        if not left < policy.quieter * noise:
            continue
        yield Caveat(
            Reason.QUIETER,
            f"The residual in `{channel}` is {left:.3g}, only {left / noise:.2g} times "
            f"the stated noise ({noise:.3g}): effects smaller than the stated noise "
            "were not sought. Check the unit of the noise, or state the smaller value.",
        )
