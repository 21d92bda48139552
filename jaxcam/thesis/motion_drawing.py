"""Draw settled motions as time series and phase portraits."""

from collections.abc import Sequence

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from ..hybrid import Trajectory
from ..models import CamFollower
from ..plotting.colours import CAM, FLIGHT, IMPACT
from ..plotting.curves import trajectory_curve
from .settled import run_of, SettledMotion


_TURNS = 4
"""Smallest number of turns drawn."""


def _cam(run: Trajectory, times):
    rig = run.system
    assert isinstance(rig, CamFollower)
    return np.asarray(rig.contact_angle(rig.cam_angle(jnp.asarray(times))))


def draw_angles(ax, run: Trajectory) -> None:
    """Draw the cam (dashed) and follower angles against time."""
    drawn = trajectory_curve(run, None, 3000)
    ax.plot(drawn.time, drawn.state[:, 0], color=FLIGHT, lw=1.3, label="follower")
    times = np.linspace(float(run.t0), float(run.t1), 1500)
    ax.plot(times, _cam(run, times), "--", color=CAM, lw=1.2, label="cam")
    ax.set_ylabel("angle (rad)")


def draw_gap(ax, run: Trajectory) -> None:
    """Draw the angle between the follower and the cam against time."""
    drawn = trajectory_curve(run, None, 3000)
    ax.plot(drawn.time, drawn.gap[:, 0], color=FLIGHT, lw=1.1)
    ax.axhline(0, color="0.4", lw=0.7)
    if np.nanmax(np.abs(drawn.gap)) < 1e-9:
        # in permanent contact, choose a scale that does not show rounding errors
        ax.set_ylim(-1e-3, 1e-3)
    ax.set_ylabel("gap (rad)")


def draw_portrait(ax, run: Trajectory, motion: SettledMotion) -> None:
    """Draw velocity against angle, with the samples once per period."""
    drawn = trajectory_curve(run, None, 3000)
    ax.plot(drawn.state[:, 0], drawn.state[:, 1], color=FLIGHT, lw=0.9)
    for before, after in zip(drawn.before, drawn.after, strict=True):
        ax.plot(*np.stack([before, after], 1), "--", color=IMPACT, lw=0.5)
    turns = motion.turns or round(float(run.t1 - run.t0) / float(run.system.period))
    times = float(run.t0) + float(run.system.period) * np.arange(turns)
    points = np.asarray(run.at(times))
    ax.plot(*points.T, "o", color="k", ms=5, mec="white", mew=0.6, label="stroboscopic")
    ax.set_ylabel("velocity (rad/s)")


def _turns(motion: SettledMotion) -> int:
    return 40 if motion.turns == 0 else max(_TURNS, motion.turns)


def motion_figure(system: CamFollower, found: Sequence[SettledMotion]) -> Figure:
    """Draw a row for each motion: the angles with the gap below, and the phase
    portrait.
    """
    rows = len(found)
    figure = plt.figure(figsize=(9.6, 3.6 * rows))
    grid = figure.add_gridspec(2 * rows, 2, width_ratios=(3, 2))
    for k, motion in enumerate(found):
        whole = run_of(system, motion, _turns(motion))
        short = run_of(system, motion, max(_TURNS, motion.turns))
        top = figure.add_subplot(grid[2 * k, 0])
        below = figure.add_subplot(grid[2 * k + 1, 0], sharex=top)
        right = figure.add_subplot(grid[2 * k : 2 * k + 2, 1])
        draw_angles(top, short)
        draw_gap(below, short)
        draw_portrait(right, whole, motion)
        top.set_title(f"{motion.case.title}: {motion.label}")
        top.tick_params(labelbottom=False)
        if k == rows - 1:
            below.set_xlabel("time (s)")
            right.set_xlabel("angle (rad)")
        if k == 0:
            top.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)
            right.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0))
    return figure


def series_figure(system: CamFollower, found: Sequence[SettledMotion]) -> Figure:
    """Draw only the angles, with a panel for each motion (Figure 5.2)."""
    rows = -(-len(found) // 2)
    figure, axes = plt.subplots(rows, 2, figsize=(9.6, 2.4 * rows), squeeze=False)
    for ax, motion in zip(axes.flat, found, strict=False):
        draw_angles(ax, run_of(system, motion, max(_TURNS, motion.turns)))
        ax.set_title(f"{motion.case.title}: {motion.label}")
    for ax in axes.flat[len(found) :]:
        ax.axis("off")
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    handles, words = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, words, ncols=2, loc="outside upper right")
    return figure
