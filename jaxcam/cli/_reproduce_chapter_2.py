"""Drawings of chapter 2: maps, normal forms, manifolds, the Zeno ball, sliding."""

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from .. import plotting
from ..maps import LogisticMap, map_diagram, NORMAL_FORMS
from ..models import CamFollower
from ..plotting._style import CONTACT
from ..thesis import (
    _chapter_2,
    _chapter_2_manifolds,
    _chapter_2_sliding,
)


_LINE, _OTHER = "#0072B2", "#E69F00"


def figure_2_3(system: CamFollower) -> Figure:
    del system
    figure, axes = plt.subplots(1, 3, figsize=(9.6, 3.6))
    for ax, (mu, start) in zip(axes, _chapter_2.COBWEBS, strict=True):
        plotting.cobweb(LogisticMap(mu), start, 60, ax)
        where = dict(transform=ax.transAxes, ha="right", backgroundcolor="white")
        ax.text(0.97, 0.05, f"$\\mu = {mu}$", **where)
    return figure


def figure_2_4(system: CamFollower) -> Figure:
    del system
    figure, ax = plt.subplots()
    values = np.linspace(2.6, 4.0, 1200)
    points = np.asarray(map_diagram(LogisticMap(), lambda s: s.mu, values, keep=150))
    ax.plot(np.repeat(values, 150), points.ravel(), ",", color=_LINE, alpha=0.4)
    ax.set_xlabel(r"$\mu$")
    ax.set_ylabel("x")
    return figure


def figure_2_7(system: CamFollower) -> Figure:
    del system
    figure, axes = plt.subplots(1, 5, figsize=(12, 3), sharey=True)
    mu = np.linspace(-1, 1, 401)
    for ax, form in zip(axes, NORMAL_FORMS.values(), strict=True):
        for k, branch in enumerate(form.branches):
            x, stable = branch(mu), form.stable(k, mu)
            ax.plot(mu, np.where(stable, x, np.nan), color=_LINE, lw=1.8)
            ax.plot(mu, np.where(stable, np.nan, x), "--", color=_LINE, lw=0.9)
        ax.set_title(form.title, loc="left")
        ax.set_xlabel(r"$\mu$")
    axes[0].set_ylabel("x, or radius")
    return figure


def figure_2_11(system: CamFollower) -> Figure:
    del system
    figure, axes = plt.subplots(1, 3, figsize=(9.6, 3.6))
    for ax, (name, chosen) in zip(axes, _chapter_2.MAPS.items(), strict=True):
        for x in (np.linspace(-1, 0, 200), np.linspace(1e-9, 1, 200)):
            ax.plot(x, np.asarray(chosen(jnp.asarray(x))), color=_LINE)
        ax.plot([-1, 1], [-1, 1], color="0.7", lw=0.8)
        ax.axvline(0, color="0.7", lw=0.8, ls=":")
        ax.set_title(name.replace(", ", ",\n"), loc="left", fontsize="medium")
        ax.set_xlabel("$x_n$")
    axes[0].set_ylabel("$x_{n+1}$")
    return figure


def figure_2_8(system: CamFollower) -> Figure:
    del system
    found = _chapter_2_manifolds.manifolds()
    figure, ax = plt.subplots(figsize=(6.8, 5.0))
    for sides, colour, name in (
        (found.unstable, _LINE, "unstable manifold"),
        (found.stable, _OTHER, "stable manifold"),
    ):
        for k, side in enumerate(sides):
            ax.plot(*side.T, color=colour, lw=1.3, label=None if k else name)
    point = np.asarray(found.saddle.point)
    ax.plot(*point, "o", color="k", ms=6, label="saddle")
    ax.set_xlabel("position")
    ax.set_ylabel("velocity")
    ax.legend()
    return figure


def figure_2_13(system: CamFollower) -> Figure:
    del system
    found = _chapter_2.zeno()
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 3.9))
    times = np.linspace(0.0, float(found.run.t1), 3000)
    axes[0].plot(times, np.asarray(found.run.gap(times)), color=_LINE, label="events")
    rough = found.steps
    axes[0].plot(
        np.asarray(rough.time), np.asarray(rough.state)[:, 0], color=_OTHER, ls="--",
        lw=1, label=f"{found.counts[0]} steps",
    )  # fmt: skip
    axes[0].axvline(found.exact, color="0.5", ls=":", lw=1.2)
    axes[0].set_xlabel("time (s)")
    axes[0].set_ylabel("height (m)")
    axes[0].legend()
    lengths = float(found.run.t1) / np.array(found.counts)
    axes[1].loglog(lengths, found.errors, "o-", color=_LINE, label="accumulation time")
    level = np.exp(np.mean(np.log(found.errors / lengths)))
    axes[1].loglog(lengths, level * lengths, "--", color="0.6", label="order one")
    # labels of minor ticks run into each other over less than two decades
    axes[1].xaxis.set_minor_formatter(NullFormatter())
    axes[1].yaxis.set_minor_formatter(NullFormatter())
    axes[1].set_xlabel("length of a step (s)")
    axes[1].set_ylabel("error (s)")
    axes[1].legend()
    return figure


def figure_2_14(system: CamFollower) -> Figure:
    del system
    branch = _chapter_2_sliding.belt_branch()
    events = _chapter_2_sliding.sliding_events()
    figure = plt.figure(figsize=(10.5, 6.4))
    grid = figure.add_gridspec(2, 4)
    top = figure.add_subplot(grid[0, :])
    belts = np.array([one.belt for one in branch])
    stuck = np.array([one.stuck for one in branch])
    top.plot(belts, stuck, ".-", color=_LINE, ms=5)
    styles = zip(events.items(), (":", "-.", "--"), strict=True)
    for (name, event), dashes in styles:
        top.axvline(event.belt, color="#D55E00", ls=dashes, lw=1.4, label=name)
    top.set_xlabel("speed of the belt")
    top.set_ylabel("sticks, of a turn")
    top.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3)
    names = ("crosses", "crosses and sticks", "sticks", "slips")
    drawn = zip(_chapter_2_sliding.DRAWN, names, strict=True)
    for k, (belt, name) in enumerate(drawn):
        ax = figure.add_subplot(grid[1, k])
        one = min(branch, key=lambda b: abs(b.belt - belt))
        times = np.linspace(float(one.run.t0), float(one.run.t1), 1500)
        states = np.asarray(one.run.at(jnp.asarray(times)))
        ax.plot(*states.T, color=_LINE, lw=1.2)
        held = np.zeros(len(times), dtype=bool)
        for start, end in np.asarray(one.run.sliding()):
            held |= (times >= start) & (times <= end)
        shown = np.where(held[:, None], states, np.nan)
        ax.plot(*shown.T, color=CONTACT, lw=3.2)
        ax.axhline(one.belt, color="0.5", ls=":", lw=1)
        ax.set_title(f"{name}, {one.belt:.3g}", fontsize=11)
        ax.set_xlabel("position")
    figure.axes[1].set_ylabel("velocity")
    return figure


DRAWINGS = {
    "figure-2.3": figure_2_3,
    "figure-2.4": figure_2_4,
    "figure-2.7": figure_2_7,
    "figure-2.8": figure_2_8,
    "figure-2.11": figure_2_11,
    "figure-2.13": figure_2_13,
    "figure-2.14": figure_2_14,
}
