"""Draw bifurcation diagrams from continued branches."""

from collections.abc import Callable, Iterable
from typing import Any, TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ._axes import figure_of, legend_above, one_axes
from ._branch_lines import lines_of
from ._clear_labels import Label, place_labels
from ._style import CAM, FLIGHT, IMPACT, PURPLE, SECOND, SECTION, SKY, styled
from .labels import labelled


if TYPE_CHECKING:
    from continuation import Branch, Point


# marker and colour of each kind of special point, in all figures
_MARKS = {
    "fold": ("o", IMPACT),
    "flip": ("s", SECOND),
    "Neimark-Sacker": ("D", PURPLE),
    "branch point": ("P", SECTION),
    "Hopf": ("H", SKY),
    "grazing": ("^", CAM),
    "interruption of chatter": ("*", PURPLE),
    "detachment": ("v", SKY),
}
_OTHER = ("X", SECTION)
# shorter labels next to the markers, for kinds with a long name
_SHORT = {
    "Neimark-Sacker": "NS",
    "interruption of chatter": "interruption",
}


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

    The stability of a line is that of the points between the special points at its
    ends, at which stability is undefined. Smooth curves connect the points.

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
            that would cover a line, a marker or another label is omitted.

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
    legend_above(ax)
    if letters:
        special = [point for branch in several for point in branch.special]
        place_labels(ax, _labels(special, value, x_scale))
    return figure_of(ax)


def _first_component(point) -> np.ndarray:
    found = point.observed.get("stroboscopic")
    if found is None:
        return np.asarray(point.state)[:1]
    return np.asarray(found)[:, 0]


def _draw(ax: Axes, branch, value, x_scale) -> None:
    """Draw the lines of a branch."""
    points = [p for p in branch.points if p.converged]
    rows = [np.atleast_1d(np.asarray(value(p), dtype=float)) for p in points]
    words = {True: "stable", False: "unstable", None: "_unknown"}
    for line in lines_of(points, rows):
        dashed = line.stable is False
        for column in line.values.T:
            ax.plot(
                x_scale * line.parameters,
                column,
                "--" if dashed else "-",
                color=FLIGHT,
                linewidth=1.1 if dashed else 1.8,
                zorder=2,
                label=words[line.stable],
            )


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


def _labels(points, value, x_scale) -> list[Label]:
    """Return a label for each special point."""
    found = []
    for point in points:
        y = float(np.ravel(np.asarray(value(point), dtype=float))[0])
        place = (x_scale * point.parameter, y)
        found.append(Label(word_of(point.kind), place, mark_of(point.kind)[1]))
    return found
