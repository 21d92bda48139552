"""A channel of a recording is named after what it is and its unit."""

from .labels import labelled


# endings of channel names and how their units are written; the longest ending wins
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
    """`follower_angle_rad` is "follower angle" in "rad"."""
    for ending, unit in _ENDINGS.items():
        if channel.endswith(ending) and len(channel) > len(ending):
            return channel.removesuffix(ending).replace("_", " "), unit
    return channel.replace("_", " "), "-"


def channel_label(channel: str) -> str:
    """`follower_angle_rad` is drawn on an axis "follower angle (rad)"."""
    return labelled(*name_and_unit(channel))
