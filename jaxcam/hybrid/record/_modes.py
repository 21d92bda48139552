"""List the modes of a hybrid automaton in the order in which a motion was in them."""

import equinox as eqx
import numpy as np
from jaxtyping import Float, Int

from ...tables import ShortTable
from .._automaton import HybridAutomaton
from .._system import HybridSystem
from .._wrapping import Wrapping
from ._events import Steps
from ._printed import Printed


class Modes(Printed):
    """The intervals of time that a motion spends in the modes, in order."""

    start: Float[np.ndarray, " k"]
    """Start of each interval (s), shape `(k,)`."""
    end: Float[np.ndarray, " k"]
    """End of each interval (s), shape `(k,)`; equal to the start if the next transition
    occurs at once.
    """
    mode: Int[np.ndarray, " k"]
    """Index of the mode, shape `(k,)`."""
    of_system: tuple[str, ...] = eqx.field(static=True)
    """Names of the modes of the system."""

    def names(self) -> list[str]:
        """Return the name of the mode in each interval."""
        return [self.of_system[i] for i in self.mode]

    def time_in(self, name: str) -> float:
        """Return the total time spent in a mode (s).

        Raises:
            ValueError: The system has no such mode.
        """
        if name not in self.of_system:
            raise ValueError(
                f"there is no mode {name}; the modes are {', '.join(self.of_system)}"
            )
        spent = (self.end - self.start)[self.mode == self.of_system.index(name)]
        return float(np.sum(spent))

    def _table(self) -> ShortTable:
        rows = [
            (str(k + 1), name, f"{start:.8g}", f"{end:.8g}")
            for k, (name, start, end) in enumerate(
                zip(self.names(), self.start, self.end, strict=True)
            )
        ]
        headings = ("interval", "mode", "start (s)", "end (s)")
        return ShortTable(f"intervals in modes: {len(rows)}", headings, rows)


def automaton(system: HybridSystem) -> HybridAutomaton | None:
    """Return the hybrid automaton in a system, or None."""
    while isinstance(system, Wrapping):
        system = system.inner
    return system if isinstance(system, HybridAutomaton) else None


def modes_of(system: HybridSystem, steps: Steps) -> Modes:
    """Return the modes along the integration points of a run.

    **Raises:** `ValueError` if the system has no modes.
    """
    found = automaton(system)
    if found is None:
        raise ValueError(
            f"{type(system).__name__} has no named modes; derive it from "
            "jaxcam.hybrid.HybridAutomaton"
        )
    count = int(steps.count)
    time, sides = np.asarray(steps.time)[:count], np.asarray(steps.sides)[:count]
    digits = range((len(found.modes) - 1).bit_length())
    index = sum((np.where(sides[:, b] < 0, 2**b, 0) for b in digits), np.zeros(1, int))
    first = np.append(0, np.flatnonzero(np.diff(index)) + 1)
    start = time[first]
    return Modes(start, np.append(start[1:], time[-1]), index[first], found.modes)
