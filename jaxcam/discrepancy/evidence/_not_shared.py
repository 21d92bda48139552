"""Find structures of the residuals that differ from recording to recording."""

from ..policy import Policy
from ._choice import Choice
from ._structure import Structure


def not_shared(choice: Choice, policy: Policy) -> list[Structure]:
    """Return the structures of the residuals that certainly differ from recording to
    recording.

    A structure with less gain than one that the recordings share may only be a
    consequence of it, and a small fraction of what the named terms explain may be an
    error of their form.
    """
    explained = choice.before.fit.cost - choice.named.best.fit.cost
    least = max([policy.small * explained, *(one.gain for one in choice.named.left)])
    return [
        one
        for one in choice.named.left_after
        if one.gain > max(one.threshold, least)
        and one.predicted_gain <= 0
        and one.differs
    ]
