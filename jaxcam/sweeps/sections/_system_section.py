"""What the sections of a hybrid system have in common."""

import numpy as np
from equinox import AbstractVar

from ...hybrid import HybridSystem
from ._hybrid_lanes import in_contact, lifted, turn_lengths
from ._section import AbstractSection, system_names


class AbstractSystemSection(AbstractSection):
    """A section of the motions of a hybrid system that start at one time."""

    system: AbstractVar[HybridSystem]
    #: s, where motions start
    t0: AbstractVar[float]
    #: s, length of a turn; None for the system's own forcing period
    period: AbstractVar[float | None]

    def starts(self, where=None, values=None) -> np.ndarray:
        return in_contact(self.system, self.t0, where, values)

    def turn(self, where=None, values=None) -> np.ndarray:
        return turn_lengths(self.system, self.period, where, values)

    def lifted(self, states, where=None, values=None) -> np.ndarray:
        return lifted(self.system, self.t0, states, where, values)

    def names(self, n: int) -> tuple[tuple[str, str], ...]:
        return system_names(self.system, n)
