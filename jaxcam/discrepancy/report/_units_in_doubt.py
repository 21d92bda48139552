"""Caveats that a channel may have another unit or sign than stated."""

from collections.abc import Iterator

from ..evidence import Choice
from ..policy import Policy
from ..search import Question
from ._caveats import Caveat, Reason
from ._words import ratio


def units_in_doubt(
    question: Question, choice: Choice, policy: Policy
) -> Iterator[Caveat]:
    """Return caveats if the motion does not match the stops, or if the residual is so
    large that a unit or a sign may be wrong.
    """
    if question.doubted:
        yield Caveat(Reason.UNITS, question.doubted)
    # if errors of the model were allowed for, the held-out residual refers to them
    single = [one.residual / one.stated for one in question.model_errors]
    worst = max(single, default=choice.held.after)
    if worst > policy.units_doubted:
        yield Caveat(
            Reason.UNITS,
            f"The residual is {ratio(worst)} times the noise: before anything else, "
            "check the units, the signs and the order of the columns (deg or rad, ms "
            "or s, mm or m) and the values in the rig file.",
        )
