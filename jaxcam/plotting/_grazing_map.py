"""Draw a one-dimensional map with its cobweb."""

from collections.abc import Callable

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ._axes import figure_of, legend_above, one_axes
from ._style import FLIGHT, IMPACT, RECORDED, styled


@styled
def cobweb(
    function: Callable,
    start: float,
    turns: int = 50,
    ax: Axes | None = None,
    *,
    skip: int = 0,
    edge: float | None = None,
    name: str = "x",
) -> Figure:
    """Draw a map, the diagonal, and the cobweb of one orbit.

    Args:
        function: The map, a function of a vector of points, such as `lambda x:
            variational.nordmark_map(x, mu, lam)`.
        start: First point of the orbit.
        turns: Number of iterations to draw.
        ax: Axes to draw on; default: a new figure.
        skip: Number of initial iterations that are not drawn.
        edge: Value at which impacts begin, which is marked by a dashed line.
        name: Name of the variable, in TeX.

    Returns:
        The figure.

    Raises:
        ValueError: The orbit does not stay finite.

    Examples:
        >>> from jaxcam.plotting import cobweb
        >>> figure = cobweb(lambda x: 3.2 * x * (1 - x), 0.3)
    """
    x, points = float(start), []
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(skip + turns):
            points.append(x)
            x = float(np.asarray(function(np.array([x])))[0])
    points = np.array([*points[skip:], x])
    if not np.all(np.isfinite(points)):
        raise ValueError("the orbit diverges; give another start")
    low, high = points.min(), points.max()
    if edge is not None:
        low, high = min(low, edge), max(high, edge)
    room = 0.08 * (high - low) or 1.0
    low, high = low - room, high + room
    grid = np.linspace(low, high, 1601)
    if edge is not None:
        # the slope is infinite at the edge
        grid = np.sort(np.append(grid, edge - (high - low) * np.logspace(-9, -3, 60)))
    ax = one_axes(ax)
    ax.plot([low, high], [low, high], color=RECORDED, label="_identity")
    ax.plot(grid, np.asarray(function(grid)), color=FLIGHT, label="map")
    steps = np.repeat(points, 2)
    ax.plot(
        steps[:-2], np.append(low, steps[2:-1]), color=IMPACT, linewidth=0.8,
        label="orbit",
    )  # fmt: skip
    if edge is not None:
        ax.axvline(edge, color=RECORDED, linestyle="--", linewidth=1.0, label="grazing")
    ax.set_xlim(low, high)
    ax.set_ylim(low, high)
    ax.set_aspect("equal")
    ax.set_xlabel(f"${name}_k$ (–)")
    ax.set_ylabel(f"${name}_{{k+1}}$ (–)")
    legend_above(ax)
    return figure_of(ax)
