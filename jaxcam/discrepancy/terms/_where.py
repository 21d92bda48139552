"""Parts of a motion in which physics can be missing."""

import enum


class Where(enum.StrEnum):
    """The place where an effect acts; equal to its name as a string."""

    FLIGHT = "flight"
    IMPACT = "impact"
    CONTACT = "contact"
    DRIVE = "drive"
    SENSOR = "sensor"
