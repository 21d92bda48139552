"""Drawings of chapter 6: the theory of chattering, beside the motion of the rig."""

from collections.abc import Callable
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from .. import plotting
from ..models import CamFollower
from ..plotting._curve import curve
from ..plotting._style import FLIGHT, IMPACT, RECORDED, SECTION
from ..thesis import (
    _chapter_6_manifold as manifold,
    _chapter_6_rebuilt as rebuilt,
    _chapter_6_sequence as sequence,
)


#: triangle, diamond and square of Figures 6.7 to 6.10
_MARKS = (("^", "accumulation"), ("D", "release"), ("s", "section"))


def _manifold(target: str) -> Callable[[CamFollower], Figure]:
    def draw(system: CamFollower) -> Figure:
        found = manifold.manifold_of(system, manifold.BRANCHES[target])
        figure, ax = plt.subplots(figsize=(7.8, 5.2))
        period = float(found.system.period)
        most = None if target == "figure-6.2" else 4.0
        plotting.chattering_region(
            found.frame, found.region, found.manifold, ax, period=period, most=most
        )
        ax.set_ylabel("rebound speed (rad/s)")
        return figure

    return draw


def figure_6_3(system: CamFollower) -> Figure:
    motions = manifold.series(system)
    figure, axes = plt.subplots(3, 2, figsize=(9.6, 7.2))
    for ax, one in zip(axes.flat, motions, strict=True):
        drawn = curve(one.run, None, 3000)
        start = float(one.run.t0)
        ax.plot(drawn.time - start, drawn.gap[:, 0], color=FLIGHT, lw=1.2)
        hit = drawn.impact_time - start
        ax.plot(hit, np.zeros_like(hit), ".", color=IMPACT, ms=5)
        ax.axhline(0, color="0.4", lw=0.7)
        ax.set_title(one.name, fontsize=11)
        # the graze would be lost beside the long flight after it
        last = 1.25 * (one.until - start)
        near = drawn.time - start <= one.until - start
        top = 1.25 * np.nanmax(drawn.gap[near])
        ax.set_xlim(0, last)
        ax.set_ylim(-0.08 * top, top)
        ax.axvline(one.until - start, color=RECORDED, ls=":", lw=1.2)
    for ax in axes[-1]:
        ax.set_xlabel("time (s)")
    for ax in axes[:, 0]:
        ax.set_ylabel("over cam (rad)")
    return figure


def figure_6_5(system: CamFollower) -> Figure:
    r = sequence.restitution_at(system)
    figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.6))
    for ax in axes:
        plotting.lambda_cobweb(r, ax)
    axes[1].set(xlim=(0, 0.22), ylim=(0, 0.22))
    axes[1].get_legend().remove()
    return figure


def figure_6_6(system: CamFollower) -> Figure:
    found = sequence.sequence(system)
    run = sequence.sticking_turn(system)
    figure, ax = plt.subplots(figsize=(8.4, 4.4))
    drawn = curve(run, None, 6000)
    release = float(found.frame.release) % float(found.system.period)
    ax.plot(drawn.time - release, 1e3 * drawn.gap[:, 0], color=FLIGHT, lw=1.3)
    tau = found.tau[:12]
    ax.plot(tau, np.zeros_like(tau), ".", color=IMPACT, ms=7)
    for k, place in enumerate(tau[:9]):
        ax.annotate(
            f"{k + 1}", (place, 0), (0, -13), textcoords="offset points",
            ha="center", fontsize=10,
        )  # fmt: skip
    ax.axvline(0, color=SECTION, ls=":", lw=1)
    ax.set_xlim(tau[0] - 0.01, 0.02)
    inside = (drawn.time - release > tau[0]) & (drawn.time < release)
    top = 1e3 * np.nanmax(drawn.gap[inside])
    ax.set_ylim(-0.12 * top, 1.15 * top)
    ax.set_xlabel("time from release (s)")
    ax.set_ylabel("over cam (mrad)")
    return figure


def _marked(system: CamFollower):
    found, run = sequence.sequence(system), sequence.sticking_turn(system)
    period = float(found.system.period)
    release = float(found.frame.release) % period
    times = np.array([release + found.accumulation, release, period])
    states = np.asarray(run.at(times))
    drawn = curve(run, None, 8000)
    cam = states[:, 1] - _cam_velocity(run, times)
    gaps = np.asarray(run.gap(times)).ravel()
    # of the curve: gap, its rate, without the jumps
    rate = drawn.state[:, 1] - _cam_velocity(run, drawn.time)
    return drawn, drawn.gap[:, 0], rate, times, gaps, cam, period


def _cam_velocity(run, times):
    import jax
    import jax.numpy as jnp

    rig = run.system
    assert isinstance(rig, CamFollower)
    safe = jnp.asarray(np.nan_to_num(np.asarray(times)))

    def lift(t):
        return rig.contact_angle(rig.cam_angle(t))

    return np.asarray(jax.vmap(jax.grad(lift))(safe))


def _region(close: bool) -> Callable[[CamFollower], Figure]:
    def draw(system: CamFollower) -> Figure:
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
        top.set_ylabel("over cam (mrad)")
        below.set_ylabel("velocity (rad/s)")
        below.set_xlabel("time (s)")
        right.set_xlabel("over cam (mrad)")
        right.set_ylabel("velocity (rad/s)")
        top.tick_params(labelbottom=False)
        # the section is at the end of the period, and its mark is wider
        top.set_xlim(0, 1.02 * period)
        top.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
        if close:
            top.set_xlim(times[0] - 0.03, times[1] + 0.06)
            top.set_ylim(-0.1, 6)
            below.set_ylim(-0.25, 0.25)
            right.set_xlim(-0.02, 1)
            right.set_ylim(-0.15, 0.15)
        return figure

    return draw


def figure_6_11(system: CamFollower) -> Figure:
    found, start = sequence.local_impacts(system)
    count = min(8, len(found.tau) - 1 - start)
    first, last = max(start - 5, 0), start + count
    figure, ax = plt.subplots(figsize=(7.6, 4.2))
    tau, speed = found.tau[first : last + 1], found.speed[first : last + 1]
    ax.semilogy(1e3 * tau, speed, ".-", color=FLIGHT, lw=0.9, ms=8, label="motion")
    predicted = sequence.hops(found, start, count)
    ax.semilogy(
        1e3 * predicted,
        found.speed[start : last + 1],
        "o",
        mfc="none",
        mec=IMPACT,
        ms=11,
        label="times by the lambda-map",
    )
    ax.semilogy(1e3 * found.tau[start], found.speed[start], "*", color=SECTION, ms=12,
                label="start")  # fmt: skip
    ax.axvline(1e3 * found.accumulation, color=RECORDED, ls="--", label="accumulation")
    ax.set_xlabel("time from release (ms)")
    ax.set_ylabel("rebound speed (rad/s)")
    ax.legend()
    return figure


def figure_6_12(system: CamFollower) -> Figure:
    times, acceleration, jerk = sequence.contact_derivatives(system)
    drawn = curve(sequence.sticking_turn(system), None, 3000)
    found = sequence.sequence(system)
    period = float(found.system.period)
    release = float(found.frame.release) % period
    figure, axes = plt.subplots(2, 1, figsize=(8.0, 5.6), sharex=True)
    axes[0].plot(drawn.time, drawn.gap[:, 0], color=FLIGHT)
    axes[0].set_ylabel("over cam (rad)")
    axes[1].plot(times, acceleration, color=FLIGHT, label="acceleration (rad/s²)")
    axes[1].plot(times, jerk / 10, "--", color=IMPACT, label="jerk / 10 (rad/s³)")
    axes[1].plot(release, float(found.frame.jerk) / 10, "*", color=SECTION, ms=12,
                 label="c / 10 at release")  # fmt: skip
    axes[1].axhline(0, color="0.4", lw=0.7)
    for ax in axes:
        ax.axvline(release, color=RECORDED, ls=":", lw=1.2)
    axes[1].set_xlim(0, period)
    axes[1].set_ylabel("in contact")
    axes[1].set_xlabel("time (s)")
    axes[1].legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
    return figure


def _rebuilt(found, label: str, scale: float = 1.0) -> Figure:
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 4.0))
    base = np.asarray(found.composed.relative)
    for ax, k, name in ((axes[0], 1, "velocity (rad/s)"), (axes[1], 0, "angle (rad)")):
        x = scale * found.deviations
        ax.plot(x, found.simulated[:, k] - base[k], color=FLIGHT, label="simulated")
        predicted = found.predicted[:, k] - base[k]
        ax.plot(x, predicted, "--", color=IMPACT, label="predicted")
        ax.set_ylabel(f"change of the {name}")
        ax.set_xlabel(label)
    axes[0].legend()
    return figure


def figure_6_14(system: CamFollower) -> Figure:
    found = rebuilt.rebuilt_state(system)
    return _rebuilt(found, "change of the rebound speed (mrad/s)", 1e3)


def figure_6_15(system: CamFollower) -> Figure:
    return _rebuilt(rebuilt.rebuilt_parameter(system), "change of the speed (rpm)")


def figure_6_16(system: CamFollower) -> Figure:
    found = rebuilt.rebuilt_turn(system)
    return _rebuilt(found, "deviation of the angle (mrad)", 1e3)


DRAWINGS = {
    "figure-6.2": _manifold("figure-6.2"),
    "figure-6.3": figure_6_3,
    "figure-6.4": _manifold("figure-6.4"),
    "figure-6.5": figure_6_5,
    "figure-6.6": figure_6_6,
    "figure-6.7": _region(close=False),
    "figure-6.9": _region(close=False),
    "figure-6.10": _region(close=True),
    "figure-6.11": figure_6_11,
    "figure-6.12": figure_6_12,
    "figure-6.14": figure_6_14,
    "figure-6.15": figure_6_15,
    "figure-6.16": figure_6_16,
}
