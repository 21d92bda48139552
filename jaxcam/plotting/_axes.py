"""Provide the axes of a figure, given or new, and elements that many figures share."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure


# number of letters of a legend that fit into one inch
_LETTERS_PER_INCH = 12.5


def one_axes(ax: Axes | None) -> Axes:
    """Return the given axes, or those of a new figure."""
    return plt.subplots()[1] if ax is None else ax


def figure_of(ax: Axes) -> Figure:
    """Return the figure of the axes; for a subfigure, its parent figure."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    return figure


def several_axes(axes, shape: tuple[int, int], **layout) -> tuple[Figure, np.ndarray]:
    """Return a figure and its axes, shape `shape`; `layout` goes to `plt.subplots`.

    **Raises:** `ValueError` if the number of `axes` is wrong.
    """
    rows, columns = shape
    if axes is None:
        return plt.subplots(rows, columns, squeeze=False, **layout)
    axes = np.asarray(axes, dtype=object)
    if axes.size != rows * columns:
        raise ValueError(
            f"This figure has {rows * columns} panels ({rows} rows, {columns} columns) "
            f"but `axes` has {axes.size}; create them with "
            f"`plt.subplots({rows}, {columns})`, or omit `axes`."
        )
    axes = axes.reshape(shape)
    return axes[0, 0].figure, axes


def legend_above(ax: Axes) -> None:
    """Draw a legend above the axes, clear of the curves, in two rows if necessary."""
    handles, labels = ax.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    if unique:
        width = ax.get_window_extent().width / ax.figure.dpi
        # the line and spacing of an entry take the width of about six letters
        letters = sum(map(len, unique)) + 6 * len(unique)
        rows = 1 if letters <= _LETTERS_PER_INCH * width else 2
        ax.legend(
            unique.values(),
            unique.keys(),
            **clear_corner(ax),
            ncols=-(-len(unique) // rows),
        )


def clear_corner(ax: Axes) -> dict[str, Any]:
    """Return the position of a legend above the axes: on the right if the common power
    of ten of the y-axis occupies the left.
    """
    axis = ax.yaxis
    formatter = axis.get_major_formatter()
    formatter.set_locs(axis.get_majorticklocs())  # pyright: ignore
    if formatter.get_offset():
        return {"loc": "lower right", "bbox_to_anchor": (1.0, 1.0)}
    return {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0)}
