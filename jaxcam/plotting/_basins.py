"""Draw basins of attraction."""

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from scipy.ndimage import gaussian_filter

from ._axes import figure_of, one_axes
from ._diagram import COLOURS, NOTHING
from ._style import SECTION, styled
from .labels import labelled


if TYPE_CHECKING:
    from ..sweeps import Basins


# maximum number of attractors with a separate colour and legend entry
_SHOWN = len(COLOURS) - 1
_OTHERS = "#D9D9D9"
# minimum number of cells of a picture along its shorter side
_FINE = 500
# number of cells along the shorter side from which boundaries are smoothed; in a
# coarser grid, cells left as they are next to smoothed ones would look like features
_COARSE = 64
# size of the neighbourhood of a small cell, in units of the computed cells
_BLUR = 1.2
_MARKS = "osD^vP*X"


@styled
def basin_picture(
    basins: "Basins",
    ax: Axes | None = None,
    *,
    axes: tuple[int, int] = (0, 1),
    orbits: bool = True,
) -> Figure:
    """Draw basins of attraction, one colour per attractor.

    Args:
        basins: Basins from [`jaxcam.sweeps.basins`][]; components other than those in
            `axes` must have only one value.
        ax: Axes to draw on; default: a new figure.
        axes: Components to draw along x and y.
        orbits: Whether to mark the points of the attractors.

    Returns:
        The figure.

    Raises:
        ValueError: A component that is not drawn has several values, or one that is
            drawn has only one.

    Examples:
        >>> from jaxcam import sweeps
        >>> from jaxcam.plotting import basin_picture
        >>> f = lambda x, p: jnp.stack([1.5 * x[0] - 0.5 * x[0] ** 3, x[1] / 2])
        >>> grid = sweeps.Grid([-1.0, -1.0], [1.0, 1.0], [10, 10])
        >>> figure = basin_picture(sweeps.basins(sweeps.Map(f), grid))
    """
    ax = one_axes(ax)
    grid = basins.grid
    others = [i for i in range(len(grid.shape)) if i not in axes]
    drawn = [grid.shape[i] for i in axes if i < len(grid.shape)]
    if len(drawn) < 2 or min(drawn) < 2 or any(grid.shape[i] > 1 for i in others):
        raise ValueError(
            f"the grid has shape {grid.shape}; a picture needs several values of "
            "the two components drawn, and one value of each other component"
        )
    number = np.moveaxis(basins.attractor, axes, (0, 1)).reshape(
        grid.shape[axes[0]], grid.shape[axes[1]]
    )
    colours, handles = _colours(basins, orbits)
    low, high = (np.array(corner)[list(axes)] for corner in (grid.low, grid.high))
    # index 0 (white) for states without an attractor, then one index per attractor, and
    # the last (grey) for all further attractors
    index = np.where(number < 0, 0, np.minimum(number, len(colours) - 2) + 1)
    image = ax.imshow(
        _finer(index, len(colours)).T,
        origin="lower",
        extent=(low[0], high[0], low[1], high[1]),
        cmap=ListedColormap(colours),
        vmin=-0.5,
        vmax=len(colours) - 0.5,
        interpolation="nearest",
        aspect="auto",
    )
    image.set_zorder(1)
    if orbits:
        _mark(ax, basins, axes)
    components = basins.dataset["component"].values
    units = basins.dataset["component_unit"].values
    ax.set_xlabel(labelled(str(components[axes[0]]), str(units[axes[0]])))
    ax.set_ylabel(labelled(str(components[axes[1]]), str(units[axes[1]])))
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])
    ax.grid(False)
    ax.legend(
        handles,
        [(one[0] if isinstance(one, tuple) else one).get_label() for one in handles],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=min(len(handles), 3),
    )
    return figure_of(ax)


def _finer(index, count: int) -> np.ndarray:
    """Refine the regions into smaller cells, to smooth slanting boundaries; a coarse
    grid is not refined.

    A small cell is assigned to the region that covers most of its neighbourhood. If
    that would change the computed result at the centre of a cell, the cell is not
    refined, so thin and fractal regions are not smoothed away.
    """
    factor = -(-_FINE // min(index.shape))
    if factor == 1 or min(index.shape) < _COARSE:
        return index
    # odd, so that one of the small cells is at the centre of a cell
    factor += 1 - factor % 2
    cells = np.kron(index, np.ones((factor, factor), dtype=int))
    finer, most = np.zeros_like(cells), np.zeros(cells.shape)
    for region in (*range(1, count), 0):
        if np.any(index == region):
            share = gaussian_filter(
                (cells == region).astype(float), _BLUR * factor, mode="nearest"
            )
            # states without an attractor win only if they cover more than half of the
            # neighbourhood
            least = 0.5 if region == 0 else most
            finer = np.where(share > least, region, finer)
            most = np.where(share > least, share, most)
    centres = finer[factor // 2 :: factor, factor // 2 :: factor]
    wrong = np.kron(centres != index, np.ones((factor, factor), dtype=bool))
    return np.where(wrong, cells, finer)


def _colours(basins, orbits: bool):
    """Return the colours, beginning with that of states without an attractor, and the
    entries of the legend.
    """
    names = basins.names
    colours = [NOTHING, *COLOURS[: min(len(names), _SHOWN)]]
    shares = basins.shares
    handles: list = []
    for k, (name, colour) in enumerate(zip(names, colours[1:], strict=False)):
        label = f"{name}  {shares[name].share:.1%}"
        patch = Patch(color=colour, label=label)
        mark = Line2D([], [], ls="", label=label, **_mark_of(basins, k))
        handles.append((patch, mark) if orbits else patch)
    if len(names) > _SHOWN:
        rest = sum(shares[name].share for name in names[_SHOWN:])
        colours.append(_OTHERS)
        handles.append(Patch(color=_OTHERS, label=f"others  {rest:.1%}"))
    outside = basins.attractor[basins.attractor < 0]
    if outside.size:
        word = "inadmissible" if np.all(outside == -3) else "none"
        handles.append(Patch(facecolor=NOTHING, edgecolor="0.5", label=word))
    return colours, handles


def _mark(ax: Axes, basins, axes) -> None:
    for k, orbit in enumerate(basins.orbits[:_SHOWN]):
        x, y = orbit[:, axes[0]], orbit[:, axes[1]]
        ax.plot(x, y, ls="", zorder=3, **_mark_of(basins, k))


def _mark_of(basins, k: int) -> dict:
    """Return the marker of attractor `k`; it is white, which is visible on every
    colour.
    """
    # a non-periodic attractor has many points, so its markers are small
    irregular = basins.labels[k, 1] == 0
    return {
        "marker": "o" if irregular else _MARKS[k % len(_MARKS)],
        "markersize": 2.8 if irregular else 6,
        "markerfacecolor": "white",
        "markeredgecolor": SECTION,
        "markeredgewidth": 0.4 if irregular else 0.9,
    }
