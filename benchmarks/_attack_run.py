"""A run of jaxcam in the units of its problem."""

from typing import NamedTuple

import numpy as np

import jaxcam

from ._attack_dynamics import Dynamics
from ._attack_events import Events
from ._attack_systems import Problem, stated


# number of samples at which a run is compared, in addition to the ends of its steps
SAMPLES = 60
# smallest normal acceleration used to estimate a depth, in units of the problem
_LEAST_PULL = 1e-3


class Run(NamedTuple):
    """A run of jaxcam in units of the problem."""

    events: Events
    # for each impact: how far the gap would have fallen below zero, or the height of
    # the flight that follows
    depths: np.ndarray
    # states at the ends of steps and at samples
    times: np.ndarray
    states: np.ndarray
    end: float
    # why the run did not reach its end, or an empty string
    result: str


def simulated(problem: Problem, sampled: bool = True, **options) -> Run:
    """Run jaxcam and convert the result to the units of the problem."""
    system, state, t0, t1 = stated(problem)
    found = jaxcam.simulate(system, state, t0, t1, **options)
    d = problem.mass.size
    units = np.repeat([problem.length, problem.length / problem.time], d)

    def own(times):
        return (np.asarray(times) - t0) / problem.time

    times, states = np.asarray(found.steps.time), np.asarray(found.steps.state)
    if sampled:
        some = np.linspace(t0, times[-1], SAMPLES)
        states = np.concatenate([states, np.asarray(found.at(some))])
        times = np.concatenate([times, some])
    hits, rests = found.impacts, found.contacts
    dynamics, speeds = Dynamics(problem), np.asarray(hits.speed_before) / units[-1]
    after = np.asarray(hits.after) / units
    pulls = [
        dynamics.pull(t, y)[k]
        for t, y, k in zip(own(hits.time), after, hits.constraint, strict=True)
    ]
    ends = np.where(np.asarray(rests.released), np.asarray(rests.end), np.inf)
    which = np.asarray(rests.constraint, float)
    contacts = np.stack([own(rests.start), own(ends), which], axis=1)
    impacts = np.stack([own(hits.time), np.asarray(hits.constraint, float)], axis=1)
    sequences = []
    for start, _, k in contacts:
        before = impacts[(impacts[:, 1] == k) & (impacts[:, 0] <= start)]
        if len(before) and start > 0:
            sequences.append((before[-1, 0], start))
    return Run(
        Events(impacts, contacts[np.argsort(contacts[:, 0], kind="stable")], sequences),
        depths(speeds, np.array(pulls)),
        own(times),
        states / units,
        float(own(found.steps.time)[-1]),
        found.result,
    )


def depths(speeds, pulls) -> np.ndarray:
    """The distances over which the accelerations `pulls` stop the normal velocities
    `speeds`.
    """
    return speeds**2 / (2 * np.maximum(np.abs(pulls), _LEAST_PULL))
