"""Where the motion of some recordings has been: a function is known only there."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ...fitting import Problem
from ..policy import Policy
from ..terms import Variable


# Approach speed at the end of a range in which there is no impact
_SLOWEST = 1e-3


class VisitedStates(NamedTuple):
    """Values that the recordings show of each variable, and how long they are (s).

    Positions are those of the state: offset and gain of the sensor are taken out.
    """

    position: Float[np.ndarray, " _"]
    velocity: Float[np.ndarray, " _"]
    approach: Float[np.ndarray, " _"]
    duration: float

    def ranges(self, policy: Policy):
        """Ends of position, velocity and approach speed, and the duration."""
        tail = policy.velocity_tail
        return (
            (float(self.position.min()), float(self.position.max())),
            (
                float(np.quantile(self.velocity, tail)),
                float(np.quantile(self.velocity, 1 - tail)),
            ),
            (0.0, float(np.max(self.approach, initial=_SLOWEST))),
            self.duration,
        )

    def near(
        self, variable: str, grid: Float[np.ndarray, " k"], policy: Policy
    ) -> Bool[np.ndarray, " k"]:
        """Which points of a grid have enough data near them.

        Enough is a share `policy.visited` of what they would have if the data were
        spread evenly, and two values at least. Phase and time are always visited.
        """
        values = {
            Variable.POSITION: self.position,
            Variable.VELOCITY: self.velocity,
            Variable.APPROACH: self.approach,
        }.get(Variable(variable))
        if values is None or not len(values):
            return np.ones(len(grid), dtype=bool)
        reach = policy.nearby * (grid[-1] - grid[0])
        ordered = np.sort(values)
        count = np.searchsorted(ordered, grid + reach, side="right")
        count -= np.searchsorted(ordered, grid - reach, side="left")
        enough = max(2.0, policy.visited * 2 * policy.nearby * len(values))
        return count >= enough


def visited_states(problem: Problem) -> VisitedStates:
    """Where the recordings of a problem have been."""
    states = np.asarray(problem.start.states)[np.asarray(problem.pieces.exists)]
    place, rate = problem.model.system.coordinates[0]  # pyright: ignore
    sensors = problem.model.sensors
    channels = [name for name, s in sensors.items() if s.observe == place]
    position = states[:, place]
    if channels:
        sensor = sensors[channels[0]]
        seen = np.concatenate([p.recording[channels[0]] for p in problem.segments])
        position = (seen - float(sensor.offset)) / float(sensor.gain)
    speeds = np.concatenate([part.impacts.approach for part in problem.segments])
    return VisitedStates(
        position[np.isfinite(position)],
        states[:, rate],
        speeds[np.isfinite(speeds) & (speeds > 0)],
        max(part.recording.duration for part in problem.segments),
    )
