"""Draw Floquet multipliers in the complex plane, with the unit circle."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ._axes import figure_of, legend_above, one_axes
from ._style import BAND, FLIGHT, IMPACT, RECORDED, styled


@styled
def multipliers(
    values: Sequence | np.ndarray, ax: Axes | None = None, *, reach: float | None = None
) -> Figure:
    """Draw the multipliers of one or many orbits, with the unit circle.

    Args:
        values: Multipliers, complex, shape `(n,)`, or `(orbits, n)` for the orbits of a
            branch.
        ax: Axes to draw on; default: a new figure.
        reach: Limit of both axes, which extend from `-reach` to `reach`; by default,
            large enough for all multipliers. Multipliers outside are marked at the
            edge.

    Returns:
        The figure.

    Examples:
        >>> from jaxcam.plotting import multipliers
        >>> figure = multipliers(np.array([0.5 + 0.5j, 0.5 - 0.5j]))
    """
    values = np.atleast_2d(np.asarray(values, dtype=complex)).ravel()
    values = values[np.isfinite(values)]
    ax = one_axes(ax)
    if reach is None:
        reach = 1.15 * max(1.0, float(np.abs(values).max(initial=0.0)))
    turn = np.linspace(0, 2 * np.pi, 361)
    ax.plot(np.cos(turn), np.sin(turn), color=RECORDED, zorder=1, label="unit circle")
    size = np.maximum(np.abs(np.real(values)), np.abs(np.imag(values)))
    outside = size > reach
    shown = np.where(
        outside, values * (0.98 * reach / np.maximum(size, 1e-300)), values
    )
    kinds = (
        ("stable", (np.abs(values) < 1) & ~outside, "o", FLIGHT),
        ("unstable", (np.abs(values) >= 1) & ~outside, "s", IMPACT),
        ("outside the figure", outside, "X", IMPACT),
    )
    for name, chosen, marker, colour in kinds:
        if np.any(chosen):
            ax.plot(
                np.real(shown[chosen]),
                np.imag(shown[chosen]),
                marker,
                color=colour,
                markersize=5,
                markeredgecolor="white",
                markeredgewidth=0.5,
                clip_on=False,
                label=name,
            )
    ax.axhline(0, color=BAND, linewidth=0.6, zorder=0)
    ax.axvline(0, color=BAND, linewidth=0.6, zorder=0)
    ax.set_xlim(-reach, reach)
    ax.set_ylim(-reach, reach)
    ax.set_aspect("equal")
    ax.set_xlabel(r"real part of $\mu$ (–)")
    ax.set_ylabel(r"imaginary part of $\mu$ (–)")
    legend_above(ax)
    return figure_of(ax)
