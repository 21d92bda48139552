"""Ranges of the recorded motion, to which free functions are restricted."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ...fitting import Problem
from ..policy import Policy
from ..terms import Variable


# Upper end of the range of approach speeds if there is no impact
_SLOWEST = 1e-3


class VisitedStates(NamedTuple):
    """Values of each variable in the recordings, and their duration (s).

    Positions are those of the state: offset and gain of the sensor are removed.
    """

    position: Float[np.ndarray, " _"]
    velocity: Float[np.ndarray, " _"]
    approach: Float[np.ndarray, " _"]
    duration: float

    def ranges(self, policy: Policy):
        """Return the ends of position, velocity and approach speed, and the
        duration.
        """
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
        """Return which points of a grid have enough data near them.

        The minimum is a fraction `policy.visited` of the number for a uniform
        distribution, and at least two values. Phase and time are always visited.
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
    """Return the states visited by the recordings of a problem."""
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
