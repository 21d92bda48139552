"""Common parts of the sections of a hybrid system."""

import numpy as np
from equinox import AbstractVar

from ...hybrid import HybridSystem
from ._hybrid_lanes import lane_sizes, lifted, state_in_contact, turn_lengths
from ._section import AbstractSection, system_names


class AbstractSystemSection(AbstractSection):
    """A section for motions of a hybrid system that start at the same time."""

    system: AbstractVar[HybridSystem]
    t0: AbstractVar[float]
    """Start time (s)."""
    period: AbstractVar[float | None]
    """Length of a period (s); None for the forcing period of the system."""

    def starts(self, where=None, values=None) -> np.ndarray:
        return state_in_contact(self.system, self.t0, where, values)

    def turn(self, where=None, values=None) -> np.ndarray:
        return turn_lengths(self.system, self.period, where, values)

    def sizes(self, states, samples, where=None, values=None) -> np.ndarray:
        largest = super().sizes(states, samples, where, values)
        last = np.isfinite(samples.states[:, -1]).all(axis=1)
        last &= np.isfinite(samples.times[:, -1])
        time = np.where(last, samples.times[:, -1], self.t0)
        state = np.where(last[:, None], samples.states[:, -1], np.nan_to_num(states))
        turn = self.turn(where, values)
        moved = lane_sizes(self.system, time, state, turn, where, values)
        return np.maximum(largest, np.nan_to_num(moved, posinf=0.0))

    def lifted(self, states, where=None, values=None) -> np.ndarray:
        return lifted(self.system, self.t0, states, where, values)

    def names(self, n: int) -> tuple[tuple[str, str], ...]:
        return system_names(self.system, n)
