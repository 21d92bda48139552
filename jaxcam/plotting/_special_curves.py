"""Curves of special points in two parameters: a chart of where what happens."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from ._axes import one_axes
from ._branch import mark_of
from ._style import styled
from .labels import labelled


if TYPE_CHECKING:
    from continuation import Branch


@styled
def special_curves(
    curves: "Branch | Iterable[Branch]",
    ax: Axes | None = None,
    *,
    x_label: tuple[str, str] | None = None,
    y_label: tuple[str, str] | None = None,
    x_scale: float = 1.0,
    y_scale: float = 1.0,
) -> Figure:
    """Draw curves of special points in the plane of two parameters.

    Each kind of point has the same colour as on a branch. Points of codimension two
    on the curves, and crossings with other curves found there, are marked and named.

    Args:
        curves: One or several curves from `continuation.curve`, all in the same
            parameters.
        ax: Axes to draw on; default a new figure.
        x_label: Name and unit of the first parameter; default its name.
        y_label: Name and unit of the second parameter; default its name.
        x_scale: Factor of the first parameter (30/pi for a speed in rpm).
        y_scale: Factor of the second parameter.

    Returns:
        The figure.

    Raises:
        ValueError: A branch is in one parameter only.

    Examples:
        >>> import continuation
        >>> from jaxcam.plotting import special_curves
        >>> field = lambda u, p: p["a"] + p["b"] * u + u**3
        >>> problem = continuation.Equilibrium(field, {"a": 2.0, "b": -1.0})
        >>> found = continuation.branch(problem, [-1.52], "a", (-2, 2.5), direction=-1)
        >>> where = lambda p: p["a"], lambda p: p["b"]
        >>> curve = continuation.curve(found.special[0], where, ((-2, 2.5), (-2, 1)))
        >>> figure = special_curves(curve)
    """
    ax = one_axes(ax)
    several: list[Branch] = (
        [curves] if hasattr(curves, "points") else list(curves)  # pyright: ignore
    )
    scale = np.array([x_scale, y_scale])
    for curve in several:
        if len(curve.names) != 2:
            raise ValueError(
                "a chart needs curves in two parameters; give branches made by "
                "continuation.curve"
            )
        kind = curve.points[0].signature.rsplit(" of ", 1)[0]
        values = scale * np.array([point.parameters for point in curve.points])
        ax.plot(*values.T, "-", color=mark_of(kind)[1], label=kind, zorder=2)
        for point in curve.special:
            _mark(ax, scale * np.array(point.parameters), point.kind)
    names = several[0].names if several else ("first parameter", "second parameter")
    ax.set_xlabel(labelled(*((names[0], "-") if x_label is None else x_label)))
    ax.set_ylabel(labelled(*((names[1], "-") if y_label is None else y_label)))
    ax.margins(x=0.03, y=0.0)
    # beside the curves: above them is too little room for such long names
    handles, labels = ax.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    ax.legend(
        unique.values(), unique.keys(), loc="center left", bbox_to_anchor=(1.0, 0.5)
    )
    return ax.figure  # pyright: ignore


def _mark(ax: Axes, place: np.ndarray, kind: str) -> None:
    ax.plot(*place, "o", color="black", markersize=4, zorder=4)
    ax.annotate(
        kind,
        (float(place[0]), float(place[1])),
        xytext=(5, 4),
        textcoords="offset points",
        fontsize="x-small",
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
        zorder=5,
    )
