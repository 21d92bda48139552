"""Draw brute-force bifurcation diagrams, and charts in two parameters."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, to_rgba
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ._axes import clear_corner, figure_of, one_axes
from ._style import CAM, FLIGHT, IMPACT, SECTION, styled
from .labels import labelled


if TYPE_CHECKING:
    from ..sweeps import Chart, Diagram


# colour and label of independent runs, of upward sweeps and of downward sweeps
_WAYS = {0: (SECTION, ""), 1: (FLIGHT, "upwards"), -1: (IMPACT, "downwards")}
COLOURS = (
    "#0072B2", "#E69F00", "#56B4E9", "#009E73", "#CC79A7", "#D55E00", "#F0E442",
    "#8C8C8C", "#004D7A", "#A6D8F5", "#8A5F00", "#7FD1B9", "#7A3F62", "#F4B183",
)  # fmt: skip
"""Okabe-Ito colours, followed by lighter colours for large numbers of items."""
# vertical resolution of a diagram
_ROWS = 600
# smallest and largest dots (points)
_DOTS = 0.6, 2.4
# Width of the margin beside the first and the last value, relative to their distance
_ROOM = 0.01
# colour of motions without an attractor
NOTHING = "#FFFFFF"


@styled
def sweep_diagram(
    diagram: "Diagram",
    ax: Axes | None = None,
    *,
    component: int = 0,
    phase: bool = False,
    x_label: tuple[str, str] | None = None,
    y_label: tuple[str, str] | None = None,
    x_scale: float = 1.0,
    stops: Mapping[str, float] | None = None,
) -> Figure:
    """Draw a bifurcation diagram, darker where there are many samples.

    Dots are drawn as an image, so that the file remains small even with millions of
    them.

    Args:
        diagram: The diagram from [`jaxcam.sweeps.diagram`][].
        ax: Axes to draw on; default: a new figure.
        component: Component of the state to draw.
        phase: Whether to draw the phase (in periods) of each sample instead, for
            sections that are not sampled once per period.
        x_label: Name and unit of the x-axis.
        y_label: Name and unit of the y-axis.
        x_scale: Factor applied to the parameter (30/pi for a speed in rpm).
        stops: Positions of constraints in the coordinate of the y-axis, by name, each
            drawn as a thin line; a stop far from all samples is omitted.

    Returns:
        The figure.

    Raises:
        ValueError: All samples have the same phase.

    Examples:
        >>> from jaxcam import sweeps
        >>> from jaxcam.plotting import sweep_diagram
        >>> logistic = sweeps.Map(lambda x, p: p["mu"] * x * (1 - x), {"mu": 3.2})
        >>> found = sweeps.diagram(logistic, "mu", [2.8, 3.2], [0.3], keep=16)
        >>> figure = sweep_diagram(found)
    """
    ax = one_axes(ax)
    states, values = diagram.states, x_scale * diagram.values
    points, starts, keep, _ = states.shape
    if phase:
        if "phase" not in diagram.dataset:
            raise ValueError(
                "samples one period apart all have the same phase; draw a diagram of "
                "impacts"
            )
        y = diagram.dataset["phase"].values
        y_label = ("phase", "turns") if y_label is None else y_label
    else:
        y = states[..., component]
    x = np.broadcast_to(values[:, None, None], (points, starts, keep))
    ways = [way for way in (1, -1, 0) if np.any(diagram.direction == way)]
    handles = []
    for way in ways:
        colour, word = _WAYS[way]
        some = diagram.direction == way
        # if both directions give the same result, the larger dots remain visible
        larger = 1.5 if way == 1 and len(ways) > 1 else 1.0
        size = larger * _dot_size(ax, int(np.sum(some)))
        _dots(ax, x[some], y[some], colour, size, 2 if way >= 0 else 3)
        if word:
            handles.append(
                Line2D([], [], marker="o", ls="", color=colour, ms=5, label=word)
            )
    name = str(diagram.dataset["component"].values[component])
    unit = str(diagram.dataset["component_unit"].values[component])
    ax.set_xlabel(labelled(*((diagram.parameter, "") if not x_label else x_label)))
    ax.set_ylabel(labelled(*((name, unit) if y_label is None else y_label)))
    low, high = float(values.min()), float(values.max())
    # the dots at both ends are fully visible
    room = _ROOM * (high - low)
    ax.set_xlim(low - room, high + room)
    _draw_stops(ax, {} if stops is None else stops, y[np.isfinite(y)])
    if handles:
        _above(ax, handles)
    return figure_of(ax)


def _draw_stops(ax: Axes, stops: Mapping[str, float], y) -> None:
    """Draw each stop that is no farther from the samples than they extend."""
    if not y.size:
        return
    low, high = float(np.min(y)), float(np.max(y))
    reach = high - low
    for name, place in stops.items():
        if not low - reach <= place <= high + reach:
            continue
        ax.axhline(place, color=CAM, lw=0.9, zorder=1)
        # above the line unless the samples are there
        below = place <= (low + high) / 2
        ax.annotate(
            name, (1.0, place), (-3, -2 if below else 2), ha="right",
            va="top" if below else "bottom", xycoords=("axes fraction", "data"),
            textcoords="offset points", fontsize="small", color=CAM,
        )  # fmt: skip
        # room for the name beyond the last sample
        ax.margins(y=0.08)


def _dot_size(ax: Axes, columns: int) -> float:
    """Return the diameter of a dot (points): the distance between columns, within
    limits.
    """
    width = ax.get_window_extent().width * 72 / ax.figure.dpi
    return float(np.clip(1.2 * width / max(columns, 1), *_DOTS))


def _dots(ax: Axes, x, y, colour: str, size: float, zorder: float) -> None:
    """Draw a dot at each height with samples, darker where there are many.

    `x` and `y` have shape `(columns, starts, keep)`. A single sample remains visible,
    and a periodic motion is fully dark.
    """
    finite = np.isfinite(y)
    if not np.any(finite):
        return
    low, high = y[finite].min(), y[finite].max()
    row = np.floor(_ROWS * (y - low) / ((high - low) or 1.0), where=finite, out=y * 0.0)
    column = np.broadcast_to(np.arange(len(y))[:, None, None], y.shape)
    place = column[finite] * (_ROWS + 1.0) + row[finite]
    _, first, inverse, count = np.unique(
        place, return_index=True, return_inverse=True, return_counts=True
    )
    height = np.bincount(inverse, y[finite]) / count
    keep = y.shape[-1]
    shade = (1 + np.log(np.minimum(count, keep))) / (1 + np.log(keep))
    rgba = np.tile(to_rgba(colour), (len(count), 1))
    rgba[:, 3] = shade
    ax.scatter(
        x[finite][first], height, s=size**2, c=rgba, linewidths=0, rasterized=True,
        zorder=zorder,
    )  # fmt: skip


@styled
def sweep_chart(
    chart: "Chart",
    ax: Axes | None = None,
    *,
    start: int = 0,
    x_label: tuple[str, str] | None = None,
    y_label: tuple[str, str] | None = None,
    x_scale: float = 1.0,
    y_scale: float = 1.0,
) -> Figure:
    """Draw the labels of a chart, with one colour per label.

    Args:
        chart: The chart from [`jaxcam.sweeps.chart`][].
        ax: Axes to draw on; default: a new figure.
        start: Index of the initial state, if there are several.
        x_label: Name and unit of the first parameter.
        y_label: Name and unit of the second parameter.
        x_scale: Factor applied to the first parameter.
        y_scale: Factor applied to the second parameter.

    Returns:
        The figure.

    Examples:
        >>> from jaxcam import sweeps
        >>> from jaxcam.plotting import sweep_chart
        >>> f = lambda x, p: p["a"] + p["b"] * x - x**2
        >>> quadratic = sweeps.Map(f, {"a": 0.0, "b": 0.5})
        >>> found = sweeps.chart(quadratic, ("a", "b"), [0.0, 0.1], [0.4, 0.5], [0.1])
        >>> figure = sweep_chart(found)
    """
    ax = one_axes(ax)
    labels = chart.labels[..., start].astype(str)
    known, counts = np.unique(labels, return_counts=True)
    # the most frequent labels have the most distinct colours
    known = known[np.argsort(-counts, kind="stable")]
    number = np.argmax(labels[..., None] == known, axis=-1)
    shown = min(len(known), len(COLOURS))
    number = np.minimum(number, len(COLOURS) - 1)
    mesh = ax.pcolormesh(
        x_scale * chart.first,
        y_scale * chart.second,
        number,
        cmap=ListedColormap(COLOURS[:shown]),
        vmin=-0.5,
        vmax=shown - 0.5,
        shading="nearest",
        rasterized=True,
    )
    mesh.set_zorder(1)
    words = [str(word) for word in known[:shown]]
    if len(known) > shown:
        words[-1] = "others"
    handles = [
        Patch(color=colour, label=word)
        for word, colour in zip(words, COLOURS, strict=False)
    ]
    one, other = chart.parameters
    ax.set_xlabel(labelled(*((one, "") if x_label is None else x_label)))
    ax.set_ylabel(labelled(*((other, "") if y_label is None else y_label)))
    ax.grid(False)
    _above(ax, handles)
    return figure_of(ax)


def _above(ax: Axes, handles) -> None:
    ax.legend(handles=handles, **clear_corner(ax), ncols=min(len(handles), 5))
