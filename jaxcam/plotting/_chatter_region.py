"""Draw the impacts that lead to complete chatter or to grazing."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from variational.chatter import ChatterFrame, GrazingManifold, ImpactCurve

from ._axes import figure_of, legend_above, one_axes
from ._style import BAND, FLIGHT, IMPACT, SECTION, styled


# fraction of white in the last curve of a family
_LIGHTEST = 0.5
# parts of a curve that are shorter than this (in periods) are not labelled
_NAMED = 0.04
# parts closer than this to the time axis (fraction of the height of the panel) are not
# labelled either
_LOWEST = 0.03


@styled
def chattering_picture(
    frame: ChatterFrame,
    region: ImpactCurve,
    manifold: GrazingManifold | None = None,
    ax: Axes | None = None,
    *,
    period: float,
    most: float | None = None,
) -> Figure:
    """Draw the chatter region D and the grazing manifold (thesis, Figures 6.2 and
    6.4).

    Args:
        frame: The frame from [`variational.chatter_frame`][].
        region: The region from [`variational.chattering_region`][].
        manifold: The manifold from [`variational.grazing_manifold`][].
        ax: Axes to draw on; default: a new figure.
        period: Forcing period (s).
        most: Largest speed to draw; default: 1.3 times the largest speed in the region.

    Returns:
        The figure, with rebound speed against time from release, modulo the period.

    Examples:
        >>> import variational
        >>> from jaxcam.models import ImpactOscillator
        >>> from jaxcam.plotting import chattering_picture
        >>> system = ImpactOscillator(omega=0.5, restitution=0.5)
        >>> frame = variational.chatter_frame(system)
        >>> region = variational.chattering_region(system, points=8, impacts=2)
        >>> drawn = chattering_picture(frame, region, period=float(system.period))
    """
    ax = one_axes(ax)
    release = float(frame.release)
    time = np.asarray(region.time) - release
    speed = np.asarray(region.speed)
    inside = (time > -0.75 * period) & np.isfinite(speed)
    ax.fill_between(
        time[inside] / period,
        0,
        speed[inside],
        color=BAND,
        lw=0,
        label="D: complete chatter",
    )
    ax.plot(
        time[inside] / period,
        speed[inside],
        color=SECTION,
        lw=1.4,
        label="C: boundary of D",
    )
    top = 1.3 * float(np.max(speed[inside])) if most is None else most
    ax.set(xlim=(-0.75, 0.25), ylim=(0, top))
    if manifold is not None:
        _draw(ax, manifold.before, release, period, FLIGHT, "S")
        _draw(ax, manifold.after, release, period, IMPACT, "W")
    ax.axvline(0, color=SECTION, lw=0.8, ls=":", label="release")
    ax.set_xlabel("time from release (periods)")
    ax.set_ylabel("rebound speed (units of the gap per s)")
    legend_above(ax)
    return figure_of(ax)


def _draw(ax, curves, release, period, colour, name):
    """Draw labelled curves in order of their numbers, from dark to light."""
    count = len(curves.time)
    for k, (time, speed) in enumerate(
        zip(np.asarray(curves.time), np.asarray(curves.speed), strict=True)
    ):
        shown = np.mod((time - release) / period + 0.75, 1.0) - 0.75
        # lines do not connect the two ends of the period or separate branches
        jump = np.abs(np.diff(shown)) > 0.05
        jump |= np.abs(np.diff(speed)) > 0.2 * np.nanmax(np.append(speed, 0.0))
        speed = np.array(speed)
        speed[1:][jump] = np.nan
        shade = np.array(to_rgb(colour))
        shade = shade + _LIGHTEST * k / max(count - 1, 1) * (1 - shade)
        (line,) = ax.plot(shown, speed, color=shade, lw=1.3)
        if k == 0:
            line.set_label(f"${name}^1$ to ${name}^{{{count}}}$")
        _number(ax, shown, speed, f"${name}^{{{k + 1}}}$", shade, k / count)


def _number(ax, x, y, word: str, colour, stagger: float) -> None:
    """Write the name of a curve at each part that is long enough."""
    ends, top = np.flatnonzero(np.isnan(y)), ax.get_ylim()[1]
    for part in np.split(np.arange(len(y)), ends):
        part = part[(y[part] > _LOWEST * top) & (y[part] < top)]
        if len(part) < 2 or np.ptp(x[part]) < _NAMED:
            continue
        # neighbouring curves are labelled at different places
        at = part[np.argsort(x[part])][int((0.1 + 0.5 * stagger) * len(part))]
        ax.text(
            x[at], y[at], word, color=colour, fontsize="small", ha="center",
            va="center", zorder=4,
            path_effects=[withStroke(linewidth=3, foreground="white")],
        )  # fmt: skip
