"""Ranges and rates of the recorded motion, to which free functions are adapted."""

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from ...fitting import Problem
from ...recordings.cut import usual_acceleration
from ..policy import Policy
from ..terms import Variable


# Upper end of the range of approach speeds if there is no impact
_SLOWEST = 1e-3


class VisitedStates(NamedTuple):
    """Values of each variable in the recordings; of the time (s), first and last.

    Positions are those of the state: offset and gain of the sensor are removed.
    `strides` are the changes of each variable in one integration step of fast motion.
    """

    position: Float[np.ndarray, " _"]
    velocity: Float[np.ndarray, " _"]
    approach: Float[np.ndarray, " _"]
    times: tuple[float, float]
    strides: Mapping[Variable, float]

    def ranges(self, policy: Policy):
        """Return the ranges of position, velocity, approach speed and time."""
        tail = policy.velocity_tail
        return (
            (float(self.position.min()), float(self.position.max())),
            (
                float(np.quantile(self.velocity, tail)),
                float(np.quantile(self.velocity, 1 - tail)),
            ),
            (0.0, float(np.max(self.approach, initial=_SLOWEST))),
            self.times,
        )

    def near(
        self, variable: str, grid: Float[np.ndarray, " k"], policy: Policy
    ) -> Bool[np.ndarray, " k"]:
        """Return which points of a grid have enough data near them.

        At least two values are required, and at least a fraction `policy.visited` of
        the number for a uniform distribution. All phases and times count as visited.
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
    exists = np.asarray(problem.pieces.exists)
    states = np.asarray(problem.start.states)[exists]
    place, rate = problem.model.system.coordinates[0]  # pyright: ignore
    sensors = problem.model.sensors
    channels = [name for name, s in sensors.items() if s.observe == place]
    position, push = states[:, place], 0.0
    if channels:
        sensor = sensors[channels[0]]
        seen = np.concatenate([p.recording[channels[0]] for p in problem.segments])
        position = (seen - float(sensor.offset)) / float(sensor.gain)
        runs = [part.recording for part in problem.segments]
        push = usual_acceleration(runs, channels[0]) / abs(float(sensor.gain))
    speeds = np.concatenate([part.impacts.approach for part in problem.segments])
    return VisitedStates(
        position[np.isfinite(position)],
        states[:, rate],
        speeds[np.isfinite(speeds) & (speeds > 0)],
        (
            min(float(part.recording.time[0]) for part in problem.segments),
            max(float(part.recording.time[-1]) for part in problem.segments),
        ),
        _strides(problem, exists, states[:, rate], push),
    )


def _strides(problem: Problem, exists, velocity, push: float):
    """Return the changes of each variable in one integration step of fast motion.

    **Arguments:** `velocity`: velocities of the states; `push`: a large acceleration.
    """
    step = float(np.median(np.asarray(problem.pieces.flown.step)[exists]))
    driven = all(part.drive is not None for part in problem.segments)
    period, turning = problem.model.system.period, 0.0
    if driven:
        turning = np.max(np.abs(np.asarray(problem.pieces.drive.rate)[exists]))
    elif period is not None:
        turning = 2 * math.pi / float(period)
    rates = {
        Variable.POSITION: np.max(np.abs(velocity), initial=0.0),
        Variable.VELOCITY: push,
        Variable.PHASE: turning,
        Variable.TIME: 1.0,
    }
    return {name: step * float(rate) for name, rate in rates.items()}
