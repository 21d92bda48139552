"""One chatter sequence of the rig, and its orbit."""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from variational import lambda_map
from variational.chatter import ChatterFrame, hop_ratio

from ...hybrid import simulate, Trajectory
from ...models import CamFollower
from ..interruption import accumulation_of, impacts_from_release, reference
from ..remember import remembered


class ChatterSequence(NamedTuple):
    """The impacts of the sticking orbit at a speed below the interruption."""

    system: CamFollower
    frame: ChatterFrame
    tau: np.ndarray
    """Times of the impacts, measured from release (s), shape `(k,)`."""
    speed: np.ndarray
    """Rebound speeds (rad/s), shape `(k,)`."""
    accumulation: float
    """Accumulation time, measured from release (s)."""


@remembered
def sequence(system: CamFollower) -> ChatterSequence:
    """Return the impacts at a speed as far below the interruption as in Table 6.1."""
    rig = reference(system)
    orbit = accumulation_of(rig)
    impacts = impacts_from_release(rig, 40)
    end = float(orbit.frame.release) + float(rig.period)
    found = np.asarray(impacts.found)
    tau = np.asarray(impacts.time)[found] - end
    speed = np.asarray(impacts.speed)[found]
    early = tau < 0
    rest = float(orbit.accumulation) - end
    return ChatterSequence(rig, orbit.frame, tau[early], speed[early], rest)


def hops(found: ChatterSequence, start: int, count: int) -> np.ndarray:
    """Return the times, measured from release, of impact `start` of the sequence and of
    the next `count` impacts according to the lambda-map.
    """
    r, tau = float(found.frame.restitution), float(found.tau[start])
    lam = jnp.asarray(found.speed[start] / (found.frame.jerk * tau * tau))
    made = [tau]
    for _ in range(count):
        tau *= float(hop_ratio(lam))
        lam = lambda_map(lam, r)
        made.append(tau)
    return np.array(made)


@remembered
def sticking_turn(system: CamFollower) -> Trajectory:
    """Return the orbit of Figures 6.7, 6.9 and 6.10: two turns from time zero."""
    rig = reference(system)
    run = simulate(rig, None, 0.0, 12 * float(rig.period))
    period = float(rig.period)
    return simulate(rig, run.at(np.array([10 * period]))[0], 0.0, 2 * period)
