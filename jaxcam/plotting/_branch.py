"""Draw bifurcation diagrams from continued branches."""

from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Any, TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from ._axes import figure_of, legend_above, one_axes
from ._style import FLIGHT, IMPACT, SECTION, styled
from .labels import labelled


if TYPE_CHECKING:
    from continuation import Branch, Point


# marker and colour of each kind of special point, in all figures
_MARKS = {
    "fold": ("o", IMPACT),
    "flip": ("s", "#009E73"),
    "Neimark-Sacker": ("D", "#CC79A7"),
    "branch point": ("P", SECTION),
    "Hopf": ("H", "#56B4E9"),
    "grazing": ("^", "#8A5F00"),
    "interruption of chatter": ("*", "#CC79A7"),
    "detachment": ("v", "#56B4E9"),
}
_OTHER = ("X", SECTION)
# shorter labels next to the markers, for kinds with a long name
_SHORT = {
    "Neimark-Sacker": "NS",
    "interruption of chatter": "interruption",
}
# a label is omitted if it is closer than this to another one, horizontally and
# vertically (points)
_ROOM = 26, 11


def mark_of(kind: str) -> tuple[str, str]:
    """Return the marker and colour of a kind of special point."""
    return _MARKS.get(kind, _OTHER)


def word_of(kind: str) -> str:
    """Return the name of a kind of special point in figures."""
    return str(_SHORT.get(kind, kind))


@styled
def branch_diagram(
    branches: "Branch | Iterable[Branch]",
    ax: Axes | None = None,
    *,
    value: "Callable[[Point], Any] | None" = None,
    x_label: tuple[str, str] | None = None,
    y_label: tuple[str, str] = ("state", "-"),
    x_scale: float = 1.0,
    letters: bool = True,
) -> Figure:
    """Draw branches, with stable parts solid, unstable parts dashed and special points
    marked.

    Args:
        branches: One or several branches from `continuation.branch`.
        ax: Axes to draw on; default: a new figure.
        value: Function that returns the value or values of a point to draw against the
            parameter; by default, the first component of the states sampled once per
            forcing period, or of the solution if a point has no such samples.
        x_label: Name and unit of the x-axis; default: the name of the parameter.
        y_label: Name and unit of the y-axis.
        x_scale: Factor applied to the parameter (30/pi for a speed in rpm).
        letters: Whether to label the special points in addition to the legend; a label
            that would overlap another is omitted.

    Returns:
        The figure.

    Examples:
        >>> import continuation
        >>> from jaxcam.plotting import branch_diagram
        >>> problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
        >>> found = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
        >>> figure = branch_diagram(found)
    """
    ax = one_axes(ax)
    several: list[Any] = (
        [branches] if hasattr(branches, "points") else list(branches)  # pyright: ignore
    )
    value = _first_component if value is None else value
    for branch in several:
        _draw(ax, branch, value, x_scale)
    for branch in several:
        _mark(ax, branch, value, x_scale)
    name = several[0].name if several else "parameter"
    ax.set_xlabel(labelled(*((name, "") if x_label is None else x_label)))
    ax.set_ylabel(labelled(*y_label))
    ax.margins(x=0.03, y=0.08)
    if letters:
        _name(
            ax,
            [point for branch in several for point in branch.special],
            value,
            x_scale,
        )
    legend_above(ax)
    return figure_of(ax)


def _first_component(point) -> np.ndarray:
    found = point.observed.get("stroboscopic")
    if found is None:
        return np.asarray(point.state)[:1]
    return np.asarray(found)[:, 0]


def _draw(ax: Axes, branch, value, x_scale) -> None:
    """Draw one line for each sequence of points with the same stability and
    signature.
    """
    points = [p for p in branch.points if p.converged]
    before = None
    kinds = [(p.signature, solid) for p, solid in zip(points, _solid(points))]
    for (_, stable), group in groupby(zip(kinds, points), key=lambda one: one[0]):
        run = [point for _, point in group]
        rows = [np.atleast_1d(np.asarray(value(p), dtype=float)) for p in run]
        width = len(rows[0])
        # the lines of neighbouring sequences meet
        if before is not None and len(before[1]) == width:
            run, rows = [before[0], *run], [before[1], *rows]
        before = (run[-1], rows[-1])
        x = x_scale * np.array([p.parameter for p in run])
        for column in np.array(rows).T:
            ax.plot(
                x,
                column,
                "-" if stable else "--",
                color=FLIGHT,
                linewidth=1.8 if stable else 1.1,
                zorder=2,
                label="stable" if stable else "unstable",
            )


def _solid(points) -> list[bool]:
    """Return which points belong to a solid line.

    A point of unknown stability, such as a grazing orbit, belongs to the line of its
    neighbours with the same signature.
    """
    found = [None if p.stable is None else bool(p.stable) for p in points]
    for order in (range(1, len(points)), range(len(points) - 2, -1, -1)):
        for k in order:
            near = k - 1 if order.step > 0 else k + 1
            if found[k] is None and points[k].signature == points[near].signature:
                found[k] = found[near]
    return [one is None or one for one in found]


def _mark(ax: Axes, branch, value, x_scale) -> None:
    for point in branch.special:
        mark, colour = mark_of(point.kind)
        ys = np.atleast_1d(np.asarray(value(point), dtype=float))
        ax.plot(
            np.full(len(ys), x_scale * point.parameter),
            ys,
            mark,
            color=colour,
            markersize=10 if mark == "*" else 6,
            markeredgecolor="white",
            markeredgewidth=0.6,
            zorder=4,
            label=point.kind if point.converged else f"{point.kind} (bracketed)",
        )


def _name(ax: Axes, points, value, x_scale) -> None:
    """Write a label next to each marker, if there is room."""
    # positions in the figure depend on the final axis limits
    ax.autoscale_view()
    taken: list[np.ndarray] = []
    for point in points:
        y = float(np.ravel(np.asarray(value(point), dtype=float))[0])
        place = (x_scale * point.parameter, y)
        here = ax.transData.transform(place) * 72 / ax.figure.dpi
        if any(np.all(np.abs(here - other) < _ROOM) for other in taken):
            continue
        taken.append(here)
        left = ax.transAxes.inverted().transform(ax.transData.transform(place))[0] > 0.8
        ax.annotate(
            word_of(point.kind),
            place,
            xytext=(-5 if left else 5, 5),
            textcoords="offset points",
            ha="right" if left else "left",
            fontsize="small",
            color=mark_of(point.kind)[1],
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
            # the label is drawn below the markers, because its halo would cover them
            zorder=3,
        )
