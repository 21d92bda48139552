"""What `jaxcam reproduce` draws; the drawings of chapters 1, 3 and 4."""

from collections.abc import Callable

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .. import plotting
from ..models import CamFollower, rad_s_to_rpm, rpm_to_rad_s
from ..thesis import (
    _chapter_1,
    _chapter_3,
    _chapter_3_branches as branches,
    _chapter_4,
)
from . import (
    _reproduce_chapter_2,
    _reproduce_chapter_5,
    _reproduce_chapter_6,
    _reproduce_experiment,
    _reproduce_motions,
)


_LINE, _OTHER = "#0072B2", "#E69F00"


def _turn_over_the_cam(run, ax, label, colour, dashes="solid"):
    times = np.linspace(float(run.t0), float(run.t1), 1500)
    gap = np.asarray(run.gap(times))
    ax.plot(times - times[0], gap, color=colour, ls=dashes, lw=1.2, label=label)
    ax.set_xlabel("time from release (s)")
    ax.set_ylabel("angle over cam (rad)")


def figure_1_2(system: CamFollower) -> Figure:
    run = _chapter_1.released_turn(system, _chapter_1.both_sides(system)[0])
    return plotting.phase_portrait(run).figure  # pyright: ignore


def figure_1_3(system: CamFollower) -> Figure:
    figure, axes = plt.subplots(2, 1, figsize=(6.4, 6.4))
    complete, interrupted = _chapter_1.both_sides(system)
    for rpm, colour, dashes in (
        (complete, _LINE, "solid"),
        (interrupted, _OTHER, "dashed"),
    ):
        run = _chapter_1.released_turn(system, rpm)
        for ax in axes:
            _turn_over_the_cam(run, ax, f"{rpm:g} rpm", colour, dashes)
    period = 60 / complete
    axes[1].set_xlim(0.97 * period, 1.02 * period)
    axes[1].set_ylim(-2e-7, 4e-6)
    axes[0].legend()
    return figure


def figure_3_8(system: CamFollower) -> Figure:
    branch = _chapter_3.smooth_branch(system)
    run = _chapter_3.periodic_run(system, 1.0)
    figure, axes = plt.subplots(1, 3, figsize=(12, 4))
    plotting.phase_portrait(run, axes[0])
    plotting.multipliers(branch.multipliers, axes[1])
    stable = np.max(np.abs(branch.multipliers), axis=1) < 1
    axes[2].plot(branch.speed, branch.angle, "--", color=_LINE, lw=1.2)
    angle = np.where(stable, branch.angle, np.nan)
    axes[2].plot(branch.speed, angle, "o-", ms=3, color=_LINE)
    for speed, word in ((branch.fold, "fold"), (branch.flip, "flip")):
        axes[2].axvline(speed, color=_OTHER, lw=0.9)
        axes[2].text(
            speed, 1.01, word, ha="center", transform=axes[2].get_xaxis_transform()
        )
    axes[2].set_xlabel("speed (rpm)")
    axes[2].set_ylabel("angle at the impact (rad)")
    return figure


def figure_3_11(system: CamFollower) -> Figure:
    run = _chapter_3.periodic_run(system, 1.0)
    times = np.linspace(float(run.t0), float(run.t1), 2000)
    states = np.asarray(run.at(times))
    phase = np.mod(times, float(run.system.period)) / float(run.system.period)
    figure = plt.figure()
    ax = figure.add_subplot(projection="3d")
    cuts = np.flatnonzero(np.diff(phase) < 0)
    jumps = np.searchsorted(times, np.asarray(run.impacts.time))
    pieces = np.split(np.arange(len(times)), np.unique(np.append(cuts + 1, jumps)))
    for piece in pieces:
        ax.plot(phase[piece], states[piece, 0], states[piece, 1], color=_LINE, lw=1.5)
    for t, before, after in zip(
        np.asarray(run.impacts.time),
        np.asarray(run.impacts.before),
        np.asarray(run.impacts.after),
        strict=True,
    ):
        at = np.mod(t, float(run.system.period)) / float(run.system.period)
        ax.plot([at, at], *np.stack([before, after], 1), color="#D55E00", ls="--", lw=1)
    ax.set_xlabel("phase (turns)", labelpad=8)
    ax.set_ylabel("angle (rad)", labelpad=10)
    ax.set_zlabel("velocity (rad/s)")  # pyright: ignore
    ax.set_xticks([0, 0.5, 1])
    ax.yaxis.set_major_locator(MaxNLocator(4))
    ax.set_box_aspect(None, zoom=0.85)  # pyright: ignore
    return figure


def figure_4_5(system: CamFollower) -> Figure:
    del system
    program = _chapter_4.program_of_figure_4_5()
    return plotting.motion_program(program, unit="rise")[0].figure


def figure_4_13(system: CamFollower) -> Figure:
    figure, ax = plt.subplots()
    times = np.linspace(0, 1, 800)
    ax.plot(times, np.asarray(_chapter_4.fall_angles(system, jnp.asarray(times))))
    ax.set_xlabel("time (s)")
    ax.set_ylabel("follower angle (rad)")
    return figure


def figure_4_14(system: CamFollower) -> Figure:
    run = _chapter_4.constrained_run(system)
    figure, ax = plt.subplots()
    times = np.linspace(float(run.t0), float(run.t1), 600)
    rig = run.system
    assert isinstance(rig, CamFollower)
    lift = np.asarray(rig.contact_angle(rig.cam_angle(jnp.asarray(times))))
    ax.plot(times, np.asarray(run.at(times))[:, 0], color=_LINE, label="follower")
    ax.plot(times, lift, ":", color=_OTHER, lw=2, label="contact angle")
    ax.set_xlabel("time (s)")
    ax.set_ylabel("angle (rad)")
    ax.legend()
    return figure


def figure_4_15(system: CamFollower) -> Figure:
    figure, ax = plt.subplots()
    rpm = np.linspace(130, 155, 100)
    r = [system.restitution(rpm_to_rad_s(s), jnp.zeros(())) for s in rpm]  # pyright: ignore
    ax.plot(rpm, np.asarray(r), color=_LINE, label="this rig")
    printed = _chapter_4.figure_4_15(system)["printed"]
    ax.plot(_chapter_4.SPEEDS, printed, "*", color=_OTHER, label="from Table 5.2")
    ax.set_xlabel("speed (rpm)")
    ax.set_ylabel("coefficient of restitution")
    ax.legend()
    return figure


def figure_4_16(system: CamFollower) -> Figure:
    figure, axes = plt.subplots(2, 2, figsize=(8, 5), sharey=True)
    for ax, rpm in zip(axes.ravel(), _chapter_4.BOUNCES, strict=True):
        run = _chapter_1.released_turn(system, rpm)
        _turn_over_the_cam(run, ax, f"{rpm:g} rpm", _LINE)
        ax.set_title(f"{rad_s_to_rpm(float(run.system.speed)):.0f} rpm", loc="left")  # pyright: ignore
        ax.label_outer()
    return figure


def figure_3_9(system: CamFollower) -> Figure:
    branch = branches.sticking_branch(system)
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.4))
    scale = 30 / np.pi
    plotting.branch_diagram(
        branch, axes[0], x_label=("speed", "rpm"), y_label=("angle", "rad"),
        x_scale=scale,
    )  # fmt: skip
    speeds, times, _ = branches.sticking_times(system)
    axes[1].plot(speeds, 1e3 * times, color=_LINE, label="motion")
    speeds, times = np.array(branches.sticking_along(branch)).T
    axes[1].plot(speeds, 1e3 * times, "o", ms=3.5, color=_OTHER, label="followed")
    axes[1].legend()
    for point in branch.special:
        axes[1].axvline(scale * point.parameter, color=_OTHER, ls=":", lw=1.2)
    axes[1].axhline(0, color="0.4", lw=0.7)
    axes[1].set_xlabel("speed (rpm)")
    axes[1].set_ylabel("sticking time in a turn (ms)")
    return figure


def figure_3_12(system: CamFollower) -> Figure:
    branch = branches.hitting_branch(system)
    figure, ax = plt.subplots(figsize=(7.6, 4.8))
    plotting.branch_diagram(
        branch, ax, x_label=("speed", "rpm"), y_label=("angle", "rad"),
        x_scale=30 / np.pi,
    )  # fmt: skip
    return figure


DRAWINGS: dict[str, Callable[..., Figure]] = {
    "figure-1.2": figure_1_2,
    "figure-1.3": figure_1_3,
    **_reproduce_chapter_2.DRAWINGS,
    "figure-3.8": figure_3_8,
    "figure-3.9": figure_3_9,
    "figure-3.11": figure_3_11,
    "figure-3.12": figure_3_12,
    "figure-4.5": figure_4_5,
    "figure-4.13": figure_4_13,
    "figure-4.14": figure_4_14,
    "figure-4.15": figure_4_15,
    "figure-4.16": figure_4_16,
    **_reproduce_experiment.DRAWINGS,
    **_reproduce_motions.DRAWINGS,
    **_reproduce_chapter_5.DRAWINGS,
    **_reproduce_chapter_6.DRAWINGS,
}
