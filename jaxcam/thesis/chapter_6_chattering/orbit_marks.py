"""Draw the orbit at 152.67 rpm with its marked points: Figures 6.7, 6.9 and 6.10."""

from typing import Any

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ...hybrid.surface import contact_state
from ...models import CamFollower
from ...plotting.colours import FLIGHT, IMPACT
from ...plotting.curves import trajectory_curve
from ..orbits import NEAR_CAM
from ..target import Rows
from .sequence import sequence, sticking_turn
from .table_6_1 import ACCUMULATION, RELEASE, SECTION_RELATIVE


_MARKS = (("^", "accumulation"), ("D", "release"), ("s", "section"))
"""Markers of Figures 6.7 to 6.10 (triangle, diamond, square), and their meanings."""


def compute_marks(system: CamFollower) -> Rows:
    """Compute the marked points, next to the values of Table 6.1."""
    run, found = sticking_turn(system), sequence(system)
    period = float(found.system.period)
    release = float(found.frame.release) % period
    state = np.asarray(run.at(np.array([period])))[0]
    cam = contact_state(
        found.system.prepared(), jnp.asarray([period]), jnp.array(NEAR_CAM)
    )[0]
    return [
        ("triangle: time", ACCUMULATION[0], release + found.accumulation, "s"),
        ("diamond: time", RELEASE[0], release, "s"),
        ("square: relative angle", SECTION_RELATIVE[0], state[0] - cam[0], "rad"),
        ("square: relative velocity", SECTION_RELATIVE[1], state[1] - cam[1], "rad/s"),
    ]


def _marked(system: CamFollower):
    """Return the gap and its rate along the orbit and at the marked points, and the
    period.
    """
    found, run = sequence(system), sticking_turn(system)
    period = float(found.system.period)
    release = float(found.frame.release) % period
    times = np.array([release + found.accumulation, release, period])
    states = np.asarray(run.at(times))
    drawn = trajectory_curve(run, None, 8000)
    cam = states[:, 1] - _cam_velocity(run, times)
    gaps = np.asarray(run.gap(times)).ravel()
    # rate of the gap along the curve: velocity of the follower minus that of the cam
    rate = drawn.state[:, 1] - _cam_velocity(run, drawn.time)
    return drawn, drawn.gap[:, 0], rate, times, gaps, cam, period


def _cam_velocity(run, times):
    rig = run.system
    assert isinstance(rig, CamFollower)
    safe = jnp.asarray(np.nan_to_num(np.asarray(times)))

    def lift(t):
        return rig.contact_angle(rig.cam_angle(t))

    return np.asarray(jax.vmap(jax.grad(lift))(safe))


def draw_marks(system: CamFollower, close: bool = False) -> Figure:
    """Draw the orbit with its marks; with `close`, only near the end of its chatter."""
    drawn, gap, rate, times, gaps, rates, period = _marked(system)
    gap, gaps = 1e3 * gap, 1e3 * gaps
    figure = plt.figure(figsize=(9.6, 5.2))
    grid = figure.add_gridspec(2, 2, width_ratios=(3, 2))
    top = figure.add_subplot(grid[0, 0])
    below = figure.add_subplot(grid[1, 0], sharex=top)
    right = figure.add_subplot(grid[:, 1])
    for ax, x, y in (
        (top, drawn.time, gap),
        (below, drawn.time, rate),
        (right, gap, rate),
    ):
        ax.plot(x, y, color=FLIGHT, lw=1.2)
    shown = zip(_MARKS, times, gaps, rates, strict=True)
    for (mark, name), time, height, speed in shown:
        style: dict[str, Any] = dict(
            marker=mark, ms=7, color=IMPACT, mec="white", ls=""
        )
        top.plot(time, height, label=name, **style)
        below.plot(time, speed, **style)
        right.plot(height, speed, **style)
    top.set_ylabel("gap (mrad)")
    below.set_ylabel("velocity (rad/s)")
    below.set_xlabel("time (s)")
    right.set_xlabel("gap (mrad)")
    right.set_ylabel("velocity (rad/s)")
    top.tick_params(labelbottom=False)
    # leave room for the mark of the section, which is at the end of the period
    top.set_xlim(0, 1.02 * period)
    top.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
    if close:
        top.set_xlim(times[0] - 0.03, times[1] + 0.06)
        top.set_ylim(-0.1, 6)
        below.set_ylim(-0.25, 0.25)
        right.set_xlim(-0.02, 1)
        right.set_ylim(-0.15, 0.15)
    return figure
