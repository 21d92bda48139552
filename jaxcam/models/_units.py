"""Convert revolutions per minute, which are used only in input and output."""

import math


_RAD_S_PER_RPM = 2 * math.pi / 60


def rpm_to_rad_s(speed):
    """Convert a speed from revolutions per minute to radians per second.

    Args:
        speed: Speed (rpm), any shape.

    Returns:
        Speed (rad/s), in the shape of `speed`.

    Examples:
        >>> from jaxcam.models import rpm_to_rad_s
        >>> round(float(rpm_to_rad_s(60.0)), 6)
        6.283185
    """
    return speed * _RAD_S_PER_RPM


def rad_s_to_rpm(speed):
    """Convert a speed from radians per second to revolutions per minute.

    Args:
        speed: Speed (rad/s), any shape.

    Returns:
        Speed (rpm), in the shape of `speed`.

    Examples:
        >>> from jaxcam.models import rad_s_to_rpm
        >>> round(float(rad_s_to_rpm(2 * np.pi)), 6)
        60.0
    """
    return speed / _RAD_S_PER_RPM
