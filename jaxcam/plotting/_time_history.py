"""Draw state and gap against time, with impacts marked and contacts shaded."""

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..hybrid import HybridSystem, Trajectory
from ._axes import legend_above, several_axes
from ._style import CONTACT, FLIGHT, gap_colour, IMPACT, styled
from .curves import Curve, trajectory_curve
from .labels import gap_label, state_label, time_label


@styled
def time_history(
    trajectory: Trajectory,
    axes: Sequence[Axes] | np.ndarray | None = None,
    *,
    components: Sequence[int] | None = None,
    between: tuple[float, float] | None = None,
    samples: int = 1500,
) -> Figure:
    """Plot each component of the state, and the gap, against time.

    Impacts are shown as dots on the curves, jumps as thin dashed lines, and contacts as
    shaded intervals.

    Args:
        trajectory: A trajectory of `jaxcam.simulate`.
        axes: Axes for each component and for the gap; default: a new figure.
        components: Components to draw; default: all.
        between: Time span to draw (s); default: the entire trajectory.
        samples: Number of points of a curve, in addition to those that short flights
            need.

    Returns:
        The figure.

    Raises:
        ValueError: The number of axes is wrong, or the trajectory does not cover the
            span.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.plotting import time_history
        >>> trajectory = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 1.0)
        >>> figure = time_history(trajectory)
    """
    drawn = trajectory_curve(trajectory, between, samples)
    system = trajectory.system
    if components is None:
        components = range(drawn.state.shape[1])
    rows = len(components) + 1
    figure, grid = several_axes(
        axes, (rows, 1), sharex=True, figsize=(6.4, 1.2 + 1.45 * rows)
    )
    panels = grid[:, 0]
    for ax, component in zip(panels[:-1], components, strict=True):
        _draw_component(ax, drawn, component)
        ax.set_ylabel(_narrow(state_label(system, component)))
    _draw_gap(panels[-1], drawn, system)
    panels[-1].set_ylabel(_narrow(gap_label(system)))
    panels[-1].set_xlabel(time_label(system))
    panels[-1].locator_params(axis="x", nbins=7)
    for ax in panels:
        _shade(ax, drawn)
    legend_above(panels[0])
    figure.align_ylabels(list(panels))
    return figure


def _draw_component(ax: Axes, drawn: Curve, component: int) -> None:
    ax.plot(drawn.time, drawn.state[:, component], color=FLIGHT, label="state")
    before, after = drawn.before[:, component], drawn.after[:, component]
    jumps = np.stack([before, after, np.full_like(before, np.nan)], axis=1)
    ax.plot(
        np.repeat(drawn.impact_time, 3),
        jumps.ravel(),
        color=IMPACT,
        linestyle=(0, (3, 2)),
        linewidth=0.8,
    )
    _mark_impacts(ax, drawn.impact_time, before)


def _draw_gap(ax: Axes, drawn: Curve, system: HybridSystem) -> None:
    number = drawn.gap.shape[1]
    for k in range(number):
        # a single constraint needs no name; several are distinguished by the colour
        # cycle
        one = number == 1
        label = None if one else system.constraint_name(k)
        colour = FLIGHT if one else gap_colour(k)
        ax.plot(drawn.time, drawn.gap[:, k], color=colour, label=label)
    if number > 1:
        legend_above(ax)
    ax.axhline(0.0, color="black", linewidth=0.8)
    _mark_impacts(ax, drawn.impact_time, np.zeros_like(drawn.impact_time))


def _mark_impacts(ax: Axes, time, height) -> None:
    if len(time):
        ax.plot(time, height, ".", color=IMPACT, markersize=5, label="impact", zorder=3)


def _shade(ax: Axes, drawn: Curve) -> None:
    for start, end in drawn.contacts:
        ax.axvspan(
            start, end, color=CONTACT, alpha=0.3, linewidth=0, zorder=0, label="contact"
        )


def _narrow(label: str) -> str:
    # many labels are longer than the height of a panel, so they are wrapped
    name, _, unit = label.rpartition(" (")
    return f"{textwrap.fill(name, 17)}\n({unit}"
