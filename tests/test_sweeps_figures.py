"""Figures of sweeps draw without a warning, and show what the sweeps have."""

import matplotlib
import numpy as np
import pytest


matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.colors import to_rgba
from sweep_maps import LOGISTIC, SQUARE_ROOT, SQUARED

from jaxcam import plotting
from jaxcam.plotting._basins import _finer
from jaxcam.plotting._diagram import COLOURS
from jaxcam.sweeps import basins, Chart, chart, diagram, Grid, Map


pytestmark = pytest.mark.filterwarnings("error")


@pytest.fixture(autouse=True)
def no_figure_stays_open():
    yield
    plt.close("all")


def test_a_diagram_has_a_dot_where_samples_are_and_a_colour_for_each_way():
    found = diagram(
        LOGISTIC, "mu", np.linspace(2.9, 3.5, 7), [0.3], turns=100, keep=8,
        direction="both",
    )  # fmt: skip
    figure = plotting.sweep_diagram(found, x_label=("growth", "-"))
    (ax,) = figure.axes
    up, down = ax.collections
    x, y = np.asarray(up.get_offsets()).T
    assert np.array_equal(np.unique(x), found.values[:7])
    samples = found.states[:7, 0, :, 0]
    high = np.max(samples) - np.min(samples)
    for value, column in zip(found.values[:7], samples):
        away = np.abs(column[:, None] - y[x == value])
        assert np.all(away.min(axis=0) < high / 600)
        assert np.all(away.min(axis=1) < high / 600)
    # one height of a motion that repeats is darker than one of two or four
    shades = [up.get_facecolor()[x == value, 3].max() for value in (2.9, 3.5)]
    assert shades[0] == 1 and 0 < shades[1] < 1
    assert not np.allclose(up.get_facecolor()[0, :3], down.get_facecolor()[0, :3])
    assert up.get_rasterized()
    assert ax.get_xlabel() == "growth (–)" and ax.get_ylabel() == "x1 (–)"
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words == ["upwards", "downwards"]


def test_a_picture_has_the_colours_of_its_legend(tmp_path):
    grid = Grid((-2, -1), (2, 1), (12, 6))
    found = basins(SQUARE_ROOT, grid, 40)
    figure = plotting.basin_picture(found)
    (ax,) = figure.axes
    (image,) = ax.images
    colours = image.cmap(image.norm(image.get_array()))
    half = colours.shape[1] // 2
    assert np.allclose(colours[:, :half], to_rgba(COLOURS[0]))
    assert np.allclose(colours[:, half:], to_rgba(COLOURS[1]))
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words == ["period 1 a  50.0%", "period 1 b  50.0%"]
    assert plotting.save_figure(figure, tmp_path / "a.png").stat().st_size > 5000


@pytest.mark.parametrize(("cells", "smoothed"), [(24, False), (63, False), (64, True)])
def test_a_coarse_grid_is_drawn_as_it_is(cells, smoothed):
    """The picture has one pixel per cell, equal to the computed number, up to 63."""
    row, column = np.indices((cells, cells))
    index = 1 + (row + 2 * column > cells).astype(int)
    drawn = _finer(index, 3)
    assert (drawn.shape != index.shape) == smoothed
    assert smoothed or np.array_equal(drawn, index)


def test_states_that_escape_are_white_and_named():
    figure = plotting.basin_picture(basins(SQUARED, Grid((-2, -2), (2, 2), (8, 8)), 30))
    (ax,) = figure.axes
    words = [text.get_text() for text in ax.get_legend().get_texts()]
    assert words[1] == "none"


def test_a_chart_has_a_colour_for_each_label():
    two = Map(
        lambda x, p: p["mu"] * x * (1 - x) + p["shift"], {"mu": 3.0, "shift": 0.0}
    )
    found = chart(two, ("mu", "shift"), [2.5, 3.2, 3.5], [0.0, 0.01], [0.3], turns=500)
    assert isinstance(found, Chart)
    assert found.labels[0, :, 0].tolist() == ["period 1", "period 2", "period 4"]
    (ax,) = plotting.sweep_chart(found).axes
    words = {text.get_text() for text in ax.get_legend().get_texts()}
    assert words == set(found.labels.ravel().tolist())


def test_what_cannot_be_drawn_says_so():
    line = basins(SQUARE_ROOT, Grid((-2, 0), (2, 0), (12, 1)), 40)
    with pytest.raises(ValueError, match="several values"):
        plotting.basin_picture(line)
    flat = diagram(LOGISTIC, "mu", [3.0], [0.3], turns=20, keep=4)
    with pytest.raises(ValueError, match="impacts"):
        plotting.sweep_diagram(flat, phase=True)
