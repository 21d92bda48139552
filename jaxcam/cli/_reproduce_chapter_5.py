"""Drawings of chapter 5: diagrams over the speed, basins, the local map."""

from collections.abc import Callable

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from .. import plotting
from ..models import CamFollower
from ..plotting._style import FLIGHT, IMPACT, RECORDED, SECTION
from ..thesis import (
    _chapter_5_basins as basins,
    _chapter_5_chatter as chatter,
    _chapter_5_diagrams as diagrams,
    _chapter_5_map as local,
)


_RPM = ("speed", "rpm")
_SCALE = 30 / np.pi
_ANGLE, _VELOCITY = ("angle", "rad"), ("velocity", "rad/s")


def figure_5_1(system: CamFollower, size: str) -> Figure:
    made = diagrams.both_ways(system, size)
    figure, ax = plt.subplots(figsize=(8.4, 4.8))
    plotting.sweep_diagram(made, ax, x_label=_RPM, y_label=_ANGLE, x_scale=_SCALE)
    return figure


def figure_5_9(system: CamFollower) -> Figure:
    made = chatter.impacts_at(system)
    figure, axes = plt.subplots(1, 3, figsize=(10.5, 3.8))
    phase = made.dataset["phase"].values[:, 0]
    each = chatter.impact_speeds(system)
    for k, (ax, rpm) in enumerate(zip(axes, each, strict=True)):
        speeds = chatter.rebound_speeds(system, k)
        ax.semilogy(phase[k], speeds, ".", ms=3, color=FLIGHT)
        ax.set_title(f"{rpm:g} rpm")
        ax.set_xlabel("phase (turns)")
        ax.set_ylim(1e-6, 5)
    axes[0].set_ylabel("rebound speed (rad/s)")
    return figure


def figure_5_11(system: CamFollower, size: str) -> Figure:
    made = diagrams.onset(system, size)
    figure, ax = plt.subplots(figsize=(8.4, 4.8))
    plotting.sweep_diagram(made, ax, x_label=_RPM, y_label=_ANGLE, x_scale=_SCALE)
    ax.ticklabel_format(useOffset=False)
    return figure


def figure_5_12(system: CamFollower, size: str) -> Figure:
    made = diagrams.monte_carlo(system, size)
    figure, axes = plt.subplots(2, 1, figsize=(8.4, 7.2), sharex=True)
    for k, (ax, label) in enumerate(zip(axes, (_ANGLE, _VELOCITY), strict=True)):
        plotting.sweep_diagram(
            made, ax, component=k, x_label=_RPM, y_label=label, x_scale=_SCALE
        )
        ax.label_outer()
    return figure


def _basins(target: str) -> Callable[[CamFollower, str], Figure]:
    def draw(system: CamFollower, size: str) -> Figure:
        found = basins.basins_of(system, target, size)
        figure, ax = plt.subplots(figsize=(7.2, 5.4))
        plotting.basin_picture(found, ax)
        points = basins.PICTURES[target].points
        for (x, y), name in zip(basins.places(target), points, strict=True):
            ax.plot(x, y, "+", color="k", ms=11, mew=4.5)
            ax.plot(x, y, "+", color="w", ms=9, mew=2)
            box = dict(boxstyle="round,pad=0.15", fc="white", ec="0.3", lw=0.6)
            ax.annotate(
                name, (x, y), (7, 7), textcoords="offset points", bbox=box, fontsize=11
            )
        ax.set_xlabel("angle (rad)")
        ax.set_ylabel("velocity (rad/s)")
        return figure

    return draw


def figure_5_24(system: CamFollower) -> Figure:
    speeds, times, end = chatter.sticking_times(system)
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.9))
    axes[0].plot(speeds, 1e3 * times, color=FLIGHT)
    axes[0].axvline(end, color=IMPACT, ls=":", lw=1.2)
    axes[0].set_xlabel("speed (rpm)")
    axes[0].set_ylabel("sticking time in a turn (ms)")
    below = end - speeds
    axes[1].loglog(below, 1e3 * times, color=FLIGHT, label="motion")
    root = times[-1] * np.sqrt(below / below[-1])
    axes[1].loglog(below, 1e3 * root, "--", color=RECORDED, label="a square root")
    axes[1].set_xlabel("speed below the interruption (rpm)")
    axes[1].legend()
    return figure


def figure_5_25(system: CamFollower) -> Figure:
    lobes, fitted = local.measured(system)
    figure, ax = plt.subplots(figsize=(7.2, 5.0))
    plotting.local_map(fitted, lobes, ax)
    ax.set_xlabel("angle at the section (rad)")
    ax.set_ylabel("angle a turn later (rad)")
    return figure


def _map_with_identity(ax, fitted, shift, low, high) -> None:
    # dense at every corner, where the slope is infinite
    x = float(fitted.x_0) - (float(fitted.x_0) - low) * np.linspace(0, 1, 6001) ** 3
    value = np.asarray(fitted(jnp.asarray(x)))
    shown = (x > low) & (x < high)
    ax.plot(x[shown] - shift, value[shown], color=FLIGHT, lw=1.6)
    ends = np.array([low, high]) - shift
    ax.plot(ends, ends, "--", color=RECORDED, lw=1.2)


def figure_5_26(system: CamFollower) -> Figure:
    _, fitted = local.measured(system)
    inner, outer = (local.lobe_events(fitted, k) for k in (1, 0))
    shifts = (
        ("(a) before", inner.fold - 0.3 * (inner.border - inner.fold)),
        ("(b) fold", inner.fold),
        ("(c) end at the corner", inner.border),
        ("(d) flip", inner.flip),
        ("(e) fold in the next lobe", outer.fold),
        ("(f) end at the corner", outer.border),
    )
    figure, axes = plt.subplots(2, 3, figsize=(10.5, 6.6))
    x_0, x_inf = float(fitted.x_0), float(fitted.x_inf)
    for ax, (name, shift) in zip(axes.flat, shifts, strict=True):
        _map_with_identity(ax, fitted, shift, x_inf - 0.3 * (x_0 - x_inf), x_0)
        # points at which the map meets the identity
        y = x_0 - (x_0 - x_inf) * np.linspace(1e-7, 1 - 1e-7, 40001) ** 2
        apart = y - np.asarray(fitted(jnp.asarray(y))) - shift
        near = np.flatnonzero(apart[1:] * apart[:-1] <= 0)
        ax.plot(y[near] - shift, y[near] - shift, "o", color=IMPACT, ms=4.5)
        image = np.asarray(fitted(jnp.asarray(y)))
        low, high = np.nanmin(image), np.nanmax(image)
        room = 0.08 * (high - low)
        ax.set_ylim(low - room, high + room)
        ax.set_xlim(low - 2 * room, high + 4 * room)
        ax.set_title(name)
        ax.tick_params(labelbottom=False, labelleft=False)
    figure.supxlabel("angle at the section")
    figure.supylabel("a turn later")
    return figure


def figure_5_27(system: CamFollower) -> Figure:
    lobes, fitted = local.measured(system)
    figure, ax = plt.subplots(figsize=(7.6, 5.0))
    x_0, x_inf = float(fitted.x_0), float(fitted.x_inf)
    x = x_0 - 1.25 * (x_0 - x_inf) * np.linspace(0, 1, 6001) ** 3
    ax.plot(x, np.asarray(fitted(jnp.asarray(x))), color=FLIGHT)
    ax.plot(lobes.corners[:5], lobes.values[:5], "o", color=IMPACT, ms=5)
    for j in range(4):
        ax.annotate(
            rf"$(x_{j}, \Pi(x_{j}))$",
            (lobes.corners[j], lobes.values[j]),
            ((6, 4), (6, -14), (-5, -12), (-5, -12))[j],
            textcoords="offset points",
            fontsize=10,
            ha="left" if j < 2 else "right",
        )
    limit = float(fitted.alpha_inf)
    ax.axhline(limit, color=RECORDED, ls=":", lw=1)
    ax.axvline(x_inf, color=RECORDED, ls=":", lw=1)
    ax.annotate(r"$\alpha_\infty$", (x[-1], limit), (2, 5), textcoords="offset points")
    place = (3, 0.04)
    ax.annotate(
        r"$x_\infty$", (x_inf, place[1]), xycoords=("data", "axes fraction"),
        xytext=(place[0], 0), textcoords="offset points",
    )  # fmt: skip
    low = float(lobes.values[0])
    arrow = dict(arrowstyle="<->", color=SECTION, lw=0.9)
    inner = float(lobes.corners[1])
    ax.annotate("", (inner, low), (x_0, low), arrowprops=arrow)
    ax.annotate(r"$\Delta_x$", (0.5 * (inner + x_0), low), (0, -14),
                textcoords="offset points")  # fmt: skip
    ax.annotate("", (inner, low), (inner, float(lobes.values[1])), arrowprops=arrow)
    ax.annotate(r"$\Delta_\pi$", (inner, 0.5 * (low + float(lobes.values[1]))),
                (-24, -4), textcoords="offset points")  # fmt: skip
    ax.margins(x=0.09, y=0.12)
    ax.set_xlabel("x (rad)")
    ax.set_ylabel(r"$\Pi(x)$ (rad)")
    return figure


def figure_5_28(system: CamFollower, size: str) -> Figure:
    found = local.iterated(system, size)
    figure, axes = plt.subplots(2, 1, figsize=(8.4, 7.2), sharex=True, sharey=True)
    for ax, speeds, states, name, colour in (
        (axes[0], found.speeds, found.attractor, "fitted map, iterated", FLIGHT),
        (axes[1], found.motion_speeds, found.motion, "motion", IMPACT),
    ):
        x = np.repeat(speeds, states.shape[1])
        ax.plot(x, states.ravel(), ".", ms=1.8, mew=0, color=colour, rasterized=True)
        ax.set_title(name)
        ax.set_ylabel("from the sticking state (rad)")
    axes[0].set_ylim(-6e-4, 8e-4)
    axes[1].set_xlabel("speed (rpm)")
    axes[1].ticklabel_format(axis="x", useOffset=False)
    return figure


DRAWINGS = {
    "figure-5.1": figure_5_1,
    "figure-5.9": figure_5_9,
    "figure-5.11": figure_5_11,
    "figure-5.12": figure_5_12,
    **{target: _basins(target) for target in basins.PICTURES},
    "figure-5.24": figure_5_24,
    "figure-5.25": figure_5_25,
    "figure-5.26": figure_5_26,
    "figure-5.27": figure_5_27,
    "figure-5.28": figure_5_28,
}
