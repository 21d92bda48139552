"""Revolutions per minute, which appear only at the edges of the program."""

import math


_RAD_S_PER_RPM = 2 * math.pi / 60


def rpm_to_rad_s(speed):
    """A speed in revolutions per minute as radians per second, of any shape."""
    return speed * _RAD_S_PER_RPM


def rad_s_to_rpm(speed):
    """A speed in radians per second as revolutions per minute, of any shape."""
    return speed / _RAD_S_PER_RPM
