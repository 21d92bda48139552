"""Convert names of channels to labels with units."""

from ..recordings.files import unit_of, without_unit
from .labels import labelled


def name_and_unit(channel: str) -> tuple[str, str]:
    """Split a name: `follower_angle_rad` becomes "follower angle" and "rad"."""
    return without_unit(channel), unit_of(channel).replace("^2", "²") or "-"


def channel_label(channel: str) -> str:
    """Return an axis label: "follower angle (rad)" for `follower_angle_rad`."""
    return labelled(*name_and_unit(channel))
