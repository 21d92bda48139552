"""Place labels next to points of a figure, off its lines and markers."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Bbox, BboxBase


# distances of a label from its point that are tried, and the distance from which a
# thin line connects the two (points)
_DISTANCES, _CONNECTED = (6, 11, 17, 24, 32), 15
# directions that are tried, in order of preference; those with the opposite sign of x
# come first near the right edge
_DIRECTIONS = ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
# free space around a label, and half the width of a marker (points)
_MARGIN, _MARKER = 1.5, 4.0
# distance between points at which lines are examined (pixels)
_SPACING = 1.5
# fraction of the width of the axes beyond which a point is near the right edge
_EDGE = 0.8


class Label(NamedTuple):
    """A text next to a point."""

    text: str
    place: tuple[float, float]
    colour: str


def place_labels(ax: Axes, labels: Iterable[Label]) -> None:
    """Write labels next to their points, where they cover no line, marker or other
    label. A label for which there is no such place is omitted.
    """
    figure = ax.get_figure(root=True)
    assert figure is not None
    # positions depend on the final layout and axis limits
    figure.draw_without_rendering()
    labels = list(labels)
    unit = figure.dpi / 72
    here = [np.asarray(ax.transData.transform(one.place)) for one in labels]
    size = _MARKER * unit
    marks = [Bbox([spot - size, spot + size]) for spot in here]
    lines = _sampled_lines(ax)
    taken: list[Bbox] = []
    for number, (label, spot) in enumerate(zip(labels, here, strict=True)):
        if not np.all(np.isfinite(spot)):
            continue
        others = [*taken, *marks[:number], *marks[number + 1 :]]
        box = _written(ax, label, spot, lines, others, unit)
        if box is not None:
            taken.append(box)


def _written(ax: Axes, label: Label, spot, lines, others, unit: float) -> Bbox | None:
    """Write one label at the first free place; return its box, or None."""
    across = ax.transAxes.inverted().transform(spot)[0]
    turn = -1 if across > _EDGE else 1
    note = ax.annotate(
        label.text,
        label.place,
        xytext=(0, 0),
        textcoords="offset points",
        fontsize="small",
        color=label.colour,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
        # the label is drawn below the markers, because its halo would cover them
        zorder=3,
    )
    for distance in _DISTANCES:
        for x, y in _DIRECTIONS:
            x, step = turn * x, distance if x * y == 0 else 0.8 * distance
            note.set_position((x * step, y * step))
            note.set_horizontalalignment(("center", "left", "right")[x])
            note.set_verticalalignment(("center", "bottom", "top")[y])
            box = note.get_window_extent().padded(_MARGIN * unit)
            if _free(box, ax.bbox, lines, others):
                if distance >= _CONNECTED:
                    _connect(ax, label, (x * step, y * step))
                return box
    note.remove()
    return None


def _connect(ax: Axes, label: Label, offset: tuple[float, float]) -> None:
    """Draw a thin line from a point to its label."""
    thin = {"arrowstyle": "-", "color": label.colour, "linewidth": 0.5}
    ax.annotate(
        "",
        label.place,
        xytext=offset,
        textcoords="offset points",
        arrowprops={**thin, "shrinkA": 0, "shrinkB": _MARKER},
        zorder=3,
    )


def _free(box: Bbox, axes: BboxBase, lines: np.ndarray, others: list[Bbox]) -> bool:
    """Return whether a label lies inside the axes and covers nothing."""
    inside = axes.x0 <= box.x0 and box.x1 <= axes.x1
    inside = inside and axes.y0 <= box.y0 and box.y1 <= axes.y1
    if not inside or any(box.overlaps(other) for other in others):
        return False
    low, high = (box.x0, box.y0), (box.x1, box.y1)
    return not bool(np.any(np.all((lines >= low) & (lines <= high), axis=1)))


def _sampled_lines(ax: Axes) -> np.ndarray:
    """Return closely spaced points on all lines of the axes, shape `(k, 2)`."""
    found = [np.zeros((0, 2))]
    for line in ax.lines:
        rows = line.get_transform().transform(line.get_xydata())
        rows = rows[np.all(np.isfinite(rows), axis=1)]
        if line.get_linestyle() == "None" or len(rows) < 2:
            continue
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(rows, axis=0).T)))
        fine = np.linspace(0.0, along[-1], int(along[-1] / _SPACING) + 2)
        columns = [np.interp(fine, along, column) for column in rows.T]
        found.append(np.column_stack(columns))
    return np.concatenate(found)
