"""Branches of a path follower: the bifurcation figure."""

from collections.abc import Callable, Iterable
from itertools import groupby
from typing import Any, TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from ._axes import legend_above, one_axes
from ._style import CONTACT, FLIGHT, IMPACT, SECTION, styled
from .labels import labelled


if TYPE_CHECKING:
    from continuation import Branch, Point


# one mark and one colour for each kind of special point, in every figure
_MARKS = {
    "fold": ("o", IMPACT),
    "flip": ("s", "#009E73"),
    "Neimark-Sacker": ("D", "#CC79A7"),
    "branch point": ("P", SECTION),
    "Hopf": ("H", "#56B4E9"),
    "grazing": ("^", CONTACT),
    "interruption of chattering": ("*", "#CC79A7"),
    "beginning of impacts": ("v", "#56B4E9"),
}
_OTHER = ("X", SECTION)
# letters beside the marks
_SHORT = {
    "fold": "F",
    "flip": "PD",
    "Neimark-Sacker": "NS",
    "branch point": "BP",
    "Hopf": "H",
    "grazing": "G",
    "interruption of chattering": "I",
    "beginning of impacts": "B",
}


def mark_of(kind: str) -> tuple[str, str]:
    """Mark and colour of a kind of special point."""
    return _MARKS.get(kind, _OTHER)


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
    """Draw branches: stable parts solid, unstable ones dashed, special points marked.

    Args:
        branches: One or several branches from `continuation.branch`.
        ax: Axes to draw on; default a new figure.
        value: Returns from each point the number, or several, drawn against the
            parameter; default the first component of the state once per forcing period,
            where the points have it, else of their solution.
        x_label: Name and unit of the x-axis; default the parameter's name.
        y_label: Name and unit of the y-axis.
        x_scale: Factor of the parameters (30/pi for a speed in rpm).
        letters: Whether letters name the special points, besides the legend.

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
        _mark(ax, branch, value, x_scale, letters)
    name = several[0].name if several else "parameter"
    ax.set_xlabel(labelled(*((name, "-") if x_label is None else x_label)))
    ax.set_ylabel(labelled(*y_label))
    ax.margins(x=0.03, y=0.08)
    legend_above(ax)
    return ax.figure  # pyright: ignore


def _first_component(point) -> np.ndarray:
    found = point.observed.get("stroboscopic")
    if found is None:
        return np.asarray(point.state)[:1]
    return np.asarray(found)[:, 0]


def _draw(ax: Axes, branch, value, x_scale) -> None:
    """One line for each run of points of one stability and one signature."""
    points = [p for p in branch.points if p.converged]
    before = None
    for (_, stable), run in groupby(points, key=lambda p: (p.signature, _solid(p))):
        run = list(run)
        rows = [np.atleast_1d(np.asarray(value(p), dtype=float)) for p in run]
        width = len(rows[0])
        # the lines of neighbouring runs meet
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


def _solid(point) -> bool:
    return point.stable is None or bool(point.stable)


def _mark(ax: Axes, branch, value, x_scale, letters: bool) -> None:
    for point in branch.special:
        mark, colour = mark_of(point.kind)
        ys = np.atleast_1d(np.asarray(value(point), dtype=float))
        x = x_scale * point.parameter
        ax.plot(
            np.full(len(ys), x),
            ys,
            mark,
            color=colour,
            markersize=10 if mark == "*" else 6,
            markeredgecolor="white",
            markeredgewidth=0.6,
            zorder=4,
            label=point.kind if point.converged else f"{point.kind} (bracketed)",
        )
        if letters:
            ax.annotate(
                str(_SHORT.get(point.kind, point.kind)),
                (x, float(ys[0])),
                xytext=(4, 5),
                textcoords="offset points",
                fontsize="x-small",
                color=colour,
                path_effects=[withStroke(linewidth=2.5, foreground="white")],
                zorder=5,
            )
