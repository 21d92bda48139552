"""Named errors of the motion sensor."""

from typing import ClassVar

from ._term import SensorTerm, strength


class SensorLag(SensorTerm):
    """A delay in a channel of the motion."""

    name: ClassVar[str] = "sensor_lag"
    sentence: ClassVar[str] = "a lag of the sensor"
    region: ClassVar[str] = "in the measured motion, in proportion to the velocity"
    source: ClassVar[str] = "Ljung, System Identification, 1999, section 4.2"
    fields: ClassVar[tuple[str, ...]] = ("lag",)
    lag: float = strength("s", 1e-4, lower=0.0)


class SensorGain(SensorTerm):
    """A wrong gain of the sensor."""

    name: ClassVar[str] = "sensor_gain"
    sentence: ClassVar[str] = "an error in the gain of the sensor"
    region: ClassVar[str] = "in the measured motion, in proportion to it"
    source: ClassVar[str] = "Doebelin, Measurement Systems, chapter 3"
    listed: ClassVar[bool] = False
    fields: ClassVar[tuple[str, ...]] = ("gain",)
    gain: float = strength("-", 1e-3)


class SensorOffset(SensorTerm):
    """A zero offset of the sensor."""

    name: ClassVar[str] = "sensor_offset"
    sentence: ClassVar[str] = "a zero offset of the sensor"
    region: ClassVar[str] = "in the measured motion, everywhere"
    source: ClassVar[str] = "Doebelin, Measurement Systems, chapter 3"
    listed: ClassVar[bool] = False
    fields: ClassVar[tuple[str, ...]] = ("offset",)
    offset: float = strength("[q]", 1e-3)
