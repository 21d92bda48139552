"""Places where physics can be missing: flight, impact, contact, drive and sensor."""

import enum


class Where(enum.StrEnum):
    """The part of the model in which an effect acts, as a string such as `"flight"`."""

    FLIGHT = "flight"
    IMPACT = "impact"
    CONTACT = "contact"
    DRIVE = "drive"
    SENSOR = "sensor"
