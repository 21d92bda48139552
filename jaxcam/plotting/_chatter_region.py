"""Impacts that chatter to rest, and those that lead to a graze, in one plane."""

import numpy as np
from matplotlib.axes import Axes

from variational.chatter import ChatterFrame, GrazingManifold, ImpactCurve

from ._axes import legend_above, one_axes
from ._style import BAND, FLIGHT, IMPACT, SECTION, styled


@styled
def chattering_picture(
    frame: ChatterFrame,
    region: ImpactCurve,
    manifold: GrazingManifold | None = None,
    ax: Axes | None = None,
    *,
    period: float,
    most: float | None = None,
) -> Axes:
    """Draw the chattering region D and the grazing manifold (thesis, Figures 6.2 and
    6.4).

    Args:
        frame: From [`variational.chatter_frame`][].
        region: From [`variational.chattering_region`][].
        manifold: From [`variational.grazing_manifold`][].
        ax: Axes to draw on; default a new figure.
        period: Forcing period (s).
        most: Largest speed drawn; default that of the region.

    Returns:
        The axes: rebound speed over time from release, modulo the period.

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
        time[inside] / period, 0, speed[inside], color=BAND, lw=0, label="D: completes"
    )
    ax.plot(time[inside] / period, speed[inside], color=SECTION, lw=1.4, label="C")
    top = 1.3 * float(np.max(speed[inside])) if most is None else most
    if manifold is not None:
        _draw(ax, manifold.before, release, period, FLIGHT, "S")
        _draw(ax, manifold.after, release, period, IMPACT, "W")
    ax.axvline(0, color=SECTION, lw=0.8, ls=":")
    ax.set(xlim=(-0.75, 0.25), ylim=(0, top))
    ax.set_xlabel("time from release / period")
    ax.set_ylabel("rebound speed (gap / s)")
    legend_above(ax)
    return ax


def _draw(ax, curves, release, period, colour, name):
    styles = ["-", "--", "-.", ":"]
    for k, (time, speed) in enumerate(
        zip(np.asarray(curves.time), np.asarray(curves.speed), strict=True)
    ):
        shown = np.mod((time - release) / period + 0.75, 1.0) - 0.75
        # a line does not join the two ends of the period, nor separate branches
        jump = np.abs(np.diff(shown)) > 0.05
        jump |= np.abs(np.diff(speed)) > 0.2 * np.nanmax(np.append(speed, 0.0))
        speed = np.array(speed)
        speed[1:][jump] = np.nan
        ax.plot(
            shown,
            speed,
            color=colour,
            ls=styles[k % len(styles)],
            lw=1.0,
            label=f"{name}$^{k + 1}$",
        )
