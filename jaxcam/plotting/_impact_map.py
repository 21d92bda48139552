"""Draw phase (or time) and speed of each impact against those of the previous
impact.
"""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..hybrid import Trajectory
from ._axes import legend_above, several_axes
from ._style import gap_colour, IMPACT, RECORDED, styled
from .curves import Hits, hits, window
from .labels import labelled, speed_unit, time_unit


# if speeds differ by more than this factor, the scale is logarithmic
_MANY_SCALES = 1e3


@styled
def impact_return_map(
    trajectory: Trajectory,
    axes: Sequence[Axes] | np.ndarray | None = None,
    *,
    against: Literal["phase", "time"] = "phase",
    period: float | None = None,
    between: tuple[float, float] | None = None,
) -> Figure:
    """Draw impact k+1 against impact k, with the diagonal.

    The first panel shows the impact times, the second the approach speeds (the normal
    speeds just before the impacts). A point on the diagonal is an impact that repeats
    the previous one.

    Args:
        trajectory: A trajectory of `jaxcam.simulate`.
        axes: Two axes; default: a new figure.
        against: "phase" for the phase of the forcing (rad, from 0 to 2 pi), or "time"
            for the time itself (s), which is also used if there is no period.
        period: Forcing period (s); default: that of the system.
        between: Time span to draw (s), for example to omit a transient; default: the
            entire trajectory.

    Returns:
        The figure.

    Raises:
        ValueError: `against` is unknown, or the number of axes is wrong.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from jaxcam.plotting import impact_return_map
        >>> trajectory = jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 2.0)
        >>> figure = impact_return_map(trajectory, against="time")
    """
    if against not in ("phase", "time"):
        raise ValueError(f'against is {against!r}; choose "phase" or "time".')
    system = trajectory.system
    period = system.period if period is None else period
    found = hits(trajectory, *window(trajectory, between))
    figure, grid = several_axes(axes, (1, 2), figsize=(6.8, 3.2))
    left, right = grid[0]
    if against == "phase" and period is not None:
        turns = np.mod(found.time / float(period), 1.0)
        whole = (0.0, 2 * np.pi)
        _draw(left, system, 2 * np.pi * turns, found, "phase", "rad", whole)
        ticks = np.arange(5) * np.pi / 2
        names = ["0", r"$\pi/2$", r"$\pi$", r"$3\pi/2$", r"$2\pi$"]
        left.set_xticks(ticks, names)
        left.set_yticks(ticks, names)
    else:
        _draw(left, system, found.time, found, "time", time_unit(system), None)
    wide = len(found.speed) > 1 and found.speed.max() > _MANY_SCALES * found.speed.min()
    if wide and found.speed.min() > 0:
        right.set_xscale("log")
        right.set_yscale("log")
    _draw(right, system, found.speed, found, "speed", speed_unit(system), None)
    if len(np.unique(found.constraint)) > 1:
        if axes is None:
            # one legend for both panels, which stay of one size
            handles, words = right.get_legend_handles_labels()
            figure.legend(handles, words, ncols=3, loc="outside upper center")
        else:
            legend_above(right)
    return figure


def _draw(ax: Axes, system, values, found: Hits, name: str, unit: str, limits) -> None:
    if limits is None:
        limits = _limits(values, ax.get_xscale() == "log")
    ax.plot(limits, limits, color=RECORDED, linewidth=1.2, zorder=1, label="_identity")
    this, following = values[:-1], values[1:]
    kinds = np.unique(found.constraint)
    for k in kinds:
        # the constraint hit by the later of the two impacts
        chosen = found.constraint[1:] == k
        ax.plot(
            this[chosen],
            following[chosen],
            "o",
            color=IMPACT if len(kinds) == 1 else gap_colour(k),
            markersize=4,
            markeredgecolor="white",
            markeredgewidth=0.4,
            label=system.constraint_name(int(k)),
        )
    ax.set_xlim(*limits)
    ax.set_ylim(*limits)
    ax.set_aspect("equal", adjustable="box")
    ax.set_xlabel(labelled(f"{name} of impact $k$", unit))
    ax.set_ylabel(labelled(f"{name} of impact $k+1$", unit))


def _limits(values, logarithmic: bool) -> tuple[float, float]:
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    if logarithmic:
        return low / 1.5, high * 1.5
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    return low - room, high + room
