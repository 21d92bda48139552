"""Axes of residual plots: residuals in a suitable unit against drive angle or time."""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from ..fitting import Residuals
from ..recordings.files import unit_of
from ..tables import scaled


# Residuals of pure noise seldom exceed this many standard deviations
REACH = 10.0


def shown_in(part: Residuals) -> tuple[float, str]:
    """Return a factor and the unit in which the residuals of a channel are drawn."""
    return scaled(unit_of(part.channel), REACH * part.noise)


def residual_label(part: Residuals) -> str:
    """Return the label of an axis of residuals, with its unit."""
    _, unit = shown_in(part)
    return f"residual ({unit})" if unit else "residual"


def title_of(part: Residuals, parts: Sequence[Residuals]) -> str:
    """Return the name of the recording, and of the channel if there are several."""
    several = len({one.channel for one in parts}) > 1
    return f"{part.record}, {part.channel}" if several else part.record


def sides(parts: Sequence[Residuals]) -> tuple[bool, ...]:
    """Return the values of `resting` for which residuals are drawn: `False` (flight),
    and `True` (contact) if there is any contact.
    """
    return (False, True) if any(np.any(part.resting) for part in parts) else (False,)


class Along:
    """The horizontal axis of residual plots: drive angle, or time without a drive."""

    def __init__(self, parts: Sequence[Residuals]):
        self.turns = all(np.any(np.isfinite(part.turned)) for part in parts)
        if self.turns:
            self.start, self.end = 0.0, 2 * math.pi
        else:
            times = np.concatenate([part.time for part in parts])
            self.start, self.end = float(np.min(times)), float(np.max(times))

    @property
    def label(self) -> str:
        return "drive angle (rad)" if self.turns else "time (s)"

    @property
    def word(self) -> str:
        return "drive angle" if self.turns else "time"

    def place(self, part: Residuals) -> Float[np.ndarray, " k"]:
        """Return the positions of residuals on the axis, between `start` and `end`."""
        if not self.turns:
            return part.time
        return np.nan_to_num(part.turned) % (2 * math.pi)
