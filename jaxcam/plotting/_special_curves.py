"""Draw curves of special points in two parameters."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from ._axes import figure_of, one_axes
from ._branch import mark_of, word_of
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

    Each kind of point has the same colour as in a branch diagram. Points of codimension
    two on the curves are marked and named, as are crossings with other curves, if these
    were located.

    Args:
        curves: One or several curves from `continuation.curve`, all in the same
            parameters.
        ax: Axes to draw on; default: a new figure.
        x_label: Name and unit of the first parameter; default: its name.
        y_label: Name and unit of the second parameter; default: its name.
        x_scale: Factor applied to the first parameter (30/pi for a speed in rpm).
        y_scale: Factor applied to the second parameter.

    Returns:
        The figure.

    Raises:
        ValueError: A branch has only one parameter.

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
                "a chart needs curves in two parameters; give branches from "
                "continuation.curve"
            )
        kind = _kind(curve)
        values = scale * np.array([point.parameters for point in curve.points])
        ax.plot(*values.T, "-", color=mark_of(kind)[1], label=kind, zorder=2)
        for point in curve.special:
            _mark(ax, scale * np.array(point.parameters), point.kind)
    names = several[0].names if several else ("first parameter", "second parameter")
    ax.set_xlabel(labelled(*((names[0], "") if x_label is None else x_label)))
    ax.set_ylabel(labelled(*((names[1], "") if y_label is None else y_label)))
    ax.margins(x=0.03, y=0.0)
    in_order = sorted(
        several, key=lambda curve: np.mean([p.parameters[0] for p in curve.points])
    )
    for k, curve in enumerate(in_order):
        # neighbours are labelled at different heights
        _name(ax, curve, scale, 0.65 if k % 2 else 0.3)
    return figure_of(ax)


def _name(ax: Axes, curve, scale, share: float) -> None:
    """Write the kind of a curve along it, at a fraction of its height."""
    values = scale * np.array([point.parameters for point in curve.points])
    height = values[:, 1]
    wanted = height.min() + share * np.ptp(height)
    middle = int(np.argmin(np.abs(height - wanted)))
    near = values[max(middle - 3, 0) : middle + 4]
    along = near[-1] - near[0]
    kind = _kind(curve)
    ax.text(
        values[middle, 0],
        values[middle, 1],
        word_of(kind),
        ha="center",
        va="center",
        # an angle in data units, which the axes transform
        rotation=(np.rad2deg(np.arctan2(along[1], along[0])) + 90) % 180 - 90,
        rotation_mode="anchor",
        transform_rotates_text=True,
        fontsize="small",
        color=mark_of(kind)[1],
        path_effects=[withStroke(linewidth=5, foreground="white")],
        zorder=3,
    )


def _kind(curve) -> str:
    return curve.points[0].signature.rsplit(" of ", 1)[0]


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
