"""Caveats that friction may act in one direction of motion or in both."""

from ..search import OneDirection
from ..terms import CoulombFriction
from ._caveat import Caveat, Reason
from ._words import spelled


def in_one_direction(direction: OneDirection) -> Caveat:
    """Return the caveat that friction in one direction of motion explains the data
    about as well as Coulomb friction.
    """
    when = "positive" if direction.size < 0 else "negative"
    return Caveat(
        Reason.TIE,
        f"Dry friction that acts only at {when} velocities would explain the data "
        "about as well as Coulomb friction does, because the rig parameters can "
        f"represent a constant force. {_to_tell_apart(direction)}",
        (CoulombFriction.name,),
    )


def in_both_directions(direction: OneDirection) -> Caveat:
    """Return the caveat that Coulomb friction explains the data nearly as well as
    friction in one direction of motion.
    """
    return Caveat(
        Reason.TIE,
        "Coulomb friction of half the size would explain the data nearly as well as "
        "this force, because the rig parameters can represent a constant force. "
        f"{_to_tell_apart(direction)}",
        (CoulombFriction.name,),
    )


def _to_tell_apart(direction: OneDirection) -> str:
    measured = spelled(direction.hidden)
    return f"To tell the two apart, measure {measured} more accurately."
