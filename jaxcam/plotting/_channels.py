"""Convert names of channels to labels with units."""

from .labels import labelled


# endings of channel names, and the notation of their units; the longest ending wins
_ENDINGS = {
    "_rad_s2": "rad/s²",
    "_rad_s": "rad/s",
    "_m_s2": "m/s²",
    "_m_s": "m/s",
    "_rad": "rad",
    "_m": "m",
    "_s": "s",
    "_N": "N",
    "_V": "V",
}


def name_and_unit(channel: str) -> tuple[str, str]:
    """Split a name: `follower_angle_rad` becomes "follower angle" and "rad"."""
    for ending, unit in _ENDINGS.items():
        if channel.endswith(ending) and len(channel) > len(ending):
            return channel.removesuffix(ending).replace("_", " "), unit
    return channel.replace("_", " "), "-"


def channel_label(channel: str) -> str:
    """Return an axis label: "follower angle (rad)" for `follower_angle_rad`."""
    return labelled(*name_and_unit(channel))
