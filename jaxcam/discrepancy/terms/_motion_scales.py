"""Scales of the recorded motion, from which terms take their constants."""

from typing import NamedTuple


class MotionScales(NamedTuple):
    """Range of a coordinate, in its unit, and of its velocity.

    `low`, `high`: smallest and largest position; `fast`: a speed that is rarely
    exceeded; `push`: the usual acceleration; `slip`: speed over which dry friction
    changes sign.
    """

    low: float = -1.0
    high: float = 1.0
    fast: float = 1.0
    push: float = 1.0
    slip: float = 0.01

    @property
    def middle(self) -> float:
        return (self.low + self.high) / 2

    @property
    def half(self) -> float:
        """Half of the range of positions; always positive."""
        half = (self.high - self.low) / 2
        return half if half > 0 else 1.0
