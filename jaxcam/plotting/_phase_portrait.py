"""Draw one state component against another, usually velocity against position."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..hybrid import Trajectory
from ._axes import figure_of, legend_above, one_axes
from ._style import CONTACT, FLIGHT, IMPACT, SECTION, styled
from .curves import Curve, trajectory_curve, window
from .labels import state_label


@styled
def phase_portrait(
    trajectory: Trajectory,
    ax: Axes | None = None,
    *,
    components: tuple[int, int] = (0, 1),
    period: float | None = None,
    phase: float = 0.0,
    between: tuple[float, float] | None = None,
    samples: int = 1500,
) -> Figure:
    """Draw a trajectory in the plane of two state components.

    Flights and contacts are lines of different colours, jumps at impacts are thin
    dashed lines, and the stroboscopic points, one per period, are dots.

    Args:
        trajectory: A trajectory of `jaxcam.simulate`.
        ax: Axes to draw on; default: a new figure.
        components: Components to draw along x and y.
        period: Time between stroboscopic points (s); default: the forcing period;
            if there is neither, no points are drawn.
        phase: Time from `t0` to one of the stroboscopic points (s).
        between: Time span to draw (s); default: the entire trajectory.
        samples: Number of points of a curve, in addition to those that short flights
            need.

    Returns:
        The figure.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.plotting import phase_portrait
        >>> trajectory = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 1.0)
        >>> drawn = phase_portrait(trajectory)
    """
    drawn = trajectory_curve(trajectory, between, samples)
    ax = one_axes(ax)
    _draw_motion(ax, drawn, *components)
    _draw_jumps(ax, drawn, *components)
    points = _stroboscopic(trajectory, period, phase, between)
    if len(points):
        ax.plot(
            points[:, components[0]],
            points[:, components[1]],
            "o",
            color=SECTION,
            markersize=5,
            markeredgecolor="white",
            markeredgewidth=0.6,
            label="stroboscopic points",
            zorder=4,
        )
    ax.set_xlabel(state_label(trajectory.system, components[0]))
    ax.set_ylabel(state_label(trajectory.system, components[1]))
    legend_above(ax)
    return figure_of(ax)


def _draw_motion(ax: Axes, drawn: Curve, right: int, up: int) -> None:
    for held, colour, width, label in (
        (False, FLIGHT, 1.3, "flight"),
        (True, CONTACT, 2.6, "contact"),
    ):
        if np.any(drawn.contact == held):
            shown = np.where((drawn.contact == held)[:, None], drawn.state, np.nan)
            ax.plot(shown[:, right], shown[:, up], color=colour, lw=width, label=label)
    resting = _resting(drawn)[:, [right, up]]
    ax.plot(*resting.T, "s", color=CONTACT, ms=6, markeredgecolor="white", zorder=3)


def _resting(drawn: Curve) -> np.ndarray:
    """Return the states of contacts that are single points, as on a floor at rest.

    A line through equal points would not be visible.
    """
    size = np.nanmax(drawn.state, axis=0) - np.nanmin(drawn.state, axis=0)
    ends = np.flatnonzero(np.isnan(drawn.time))
    pieces = [
        drawn.state[start:end]
        for start, end in zip(np.append(0, ends[:-1] + 1), ends, strict=True)
        if drawn.contact[start]
    ]
    still = [piece[0] for piece in pieces if np.all(np.ptp(piece, 0) <= 1e-6 * size)]
    return np.array(still).reshape(-1, drawn.state.shape[1])


def _draw_jumps(ax: Axes, drawn: Curve, right: int, up: int) -> None:
    if not len(drawn.impact_time):
        return
    gap = np.full_like(drawn.before, np.nan)
    jumps = np.stack([drawn.before, drawn.after, gap], axis=1)
    jumps = jumps.reshape(-1, drawn.before.shape[1])
    ax.plot(
        jumps[:, right],
        jumps[:, up],
        color=IMPACT,
        linestyle=(0, (4, 2)),
        linewidth=0.8,
        label="impact",
    )


def _stroboscopic(trajectory, period, phase, between) -> np.ndarray:
    period = trajectory.system.period if period is None else period
    if period is None:
        return np.empty((0, 0))
    start, stop = window(trajectory, between)
    first, period = float(trajectory.t0) + phase, float(period)
    # keep a point at the end of the span in spite of rounding
    count = np.floor(np.array([first - start, stop - first]) / period + 1e-9)
    times = first + period * np.arange(-count[0], count[1] + 1)
    if not len(times):
        return np.empty((0, 0))
    return np.asarray(trajectory.at(np.clip(times, start, stop)))
