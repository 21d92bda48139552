"""Figure 3.11: the two discontinuities of the flow, in velocity and in phase."""

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from ...hybrid import simulate, Trajectory
from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT
from ..orbits import first_orbit, orbit_at
from ..remember import remembered
from ..speeds import at_rpm
from ..target import Rows, Target


SPEED = 147.941373499943
"""Speed at which the orbit is drawn (rpm)."""


@remembered
def periodic_run(system: CamFollower, turns: float = 2.0) -> Trajectory:
    """Return the P(1,1) orbit of Figures 3.8 (a) and 3.11, starting half a turn after
    an impact.

    Raises:
        ValueError: The rig has no such orbit.
    """
    start = first_orbit(system)
    if start is None:
        raise ValueError("This rig has no P(1,1) orbit near 148 rpm; choose another.")
    rig = at_rpm(system, SPEED)
    orbit = orbit_at(system, start, SPEED)
    period = float(rig.period)
    # half a turn later the follower is in flight
    time = float(orbit.times[0]) + period / 2
    state = simulate(rig, orbit.states[0], time - period / 2, time).final
    return simulate(rig, state, time, time + turns * period)


def compute(system: CamFollower) -> Rows:
    run = periodic_run(system)
    before, after = np.asarray(run.impacts.before), np.asarray(run.impacts.after)
    jump = after[0, 1] - before[0, 1]
    back = np.max(np.abs(np.asarray(run.final - run.steps.state[0])))
    return [
        ("velocity jump at the impact", np.nan, jump, "rad/s"),
        ("angle jump at the impact", 0.0, after[0, 0] - before[0, 0], "rad"),
        ("closing of the orbit after two turns", 0.0, back, ""),
        ("impacts in two turns", 2, len(before), ""),
    ]


def draw(system: CamFollower) -> Figure:
    run = periodic_run(system, 1.0)
    times = np.linspace(float(run.t0), float(run.t1), 2000)
    states = np.asarray(run.at(times))
    phase = np.mod(times, float(run.system.period)) / float(run.system.period)
    figure = plt.figure()
    ax = figure.add_subplot(projection="3d")
    cuts = np.flatnonzero(np.diff(phase) < 0)
    jumps = np.searchsorted(times, np.asarray(run.impacts.time))
    pieces = np.split(np.arange(len(times)), np.unique(np.append(cuts + 1, jumps)))
    for piece in pieces:
        ax.plot(phase[piece], states[piece, 0], states[piece, 1], color=FLIGHT, lw=1.5)
    for t, before, after in zip(
        np.asarray(run.impacts.time),
        np.asarray(run.impacts.before),
        np.asarray(run.impacts.after),
        strict=True,
    ):
        at = np.mod(t, float(run.system.period)) / float(run.system.period)
        ax.plot([at, at], *np.stack([before, after], 1), color=IMPACT, ls="--", lw=1)
    ax.set_xlabel("phase (turns)", labelpad=8)
    ax.set_ylabel("angle (rad)", labelpad=10)
    ax.set_zlabel("velocity (rad/s)")  # pyright: ignore
    ax.set_xticks([0, 0.5, 1])
    ax.yaxis.set_major_locator(MaxNLocator(4))
    ax.set_box_aspect(None, zoom=0.85)  # pyright: ignore
    return figure


TARGET = Target("The discontinuous flow of P(1,1)", compute, draw)
