"""Basins of maps with known answers, and the numbers made of them."""

import numpy as np
import pytest
from sweep_maps import (
    CANTOR_CELLS,
    CANTOR_DIMENSION,
    LOGISTIC,
    MIDDLE_THIRD,
    SQUARE_ROOT,
    SQUARED,
    TURNED,
)

from jaxcam.sweeps import (
    basin_entropy,
    basins,
    cell_mapping,
    diagram,
    Grid,
    monte_carlo,
    uncertainty_exponent,
)
from jaxcam.sweeps._cell_mapping import follow_cells


PLANE = Grid((-2, -2), (2, 2), (40, 40))


@pytest.fixture(scope="module")
def halves():
    return basins(SQUARE_ROOT, PLANE, 40)


def test_basins_of_newton_are_half_planes(halves):
    """The roots of z^2 = 1, and the sign of Re z, exactly."""
    x = PLANE.centres(0)
    assert halves.names == ["period 1 a", "period 1 b"]
    assert np.abs(halves.orbits[:, 0] - [[-1, 0], [1, 0]]).max() < 1e-12
    assert np.array_equal(halves.attractor, np.where(x[:, None] < 0, 0, 1) * np.ones(
        (1, 40), dtype=int))  # fmt: skip
    assert halves.shares["period 1 a"].share == 0.5
    # sqrt(p (1 - p) / N)
    assert halves.shares["period 1 a"].stderr == pytest.approx(0.5 / 40)


def test_states_that_escape_are_told_apart():
    found = basins(SQUARED, PLANE, 40)
    radius = np.hypot(*np.meshgrid(PLANE.centres(0), PLANE.centres(1), indexing="ij"))
    assert np.array_equal(found.attractor, np.where(radius < 1, 0, -1))
    assert set(found.shares) == {"period 1", "escaped"}
    share = found.shares["period 1"].share
    assert share == pytest.approx(np.pi / 16, abs=0.01)


def test_a_straight_boundary(halves):
    """Exponent 1; a box on the boundary would be half and half, but here none is."""
    found = uncertainty_exponent(halves.attractor)
    assert found.exponent == pytest.approx(1.0, abs=1e-12)
    assert found.dimension == pytest.approx(1.0, abs=1e-12)
    assert basin_entropy(halves.attractor, 5) == (0.0, 0.0)
    entropy = basin_entropy(halves.attractor[:, :36], 8)
    # the middle column of five: three cells of eight from the left
    assert not entropy.fractal
    p = 0.5
    assert entropy.boundary_entropy == pytest.approx(
        -2 * p * np.log(p), abs=1e-12
    )  # fmt: skip


def test_entropy_where_no_state_is_admissible():
    found = basin_entropy(np.full((10, 10), -3))
    assert np.isnan(found.entropy) and np.isnan(found.boundary_entropy)


def test_a_fractal_boundary():
    """The exponent is one less the Cantor set's dimension, ln 2 / ln 3, to 0.03."""
    grid = Grid((0,), (1,), (CANTOR_CELLS,))
    found = basins(MIDDLE_THIRD, grid, 40)
    assert np.abs(found.orbits[:, 0, 0] - [2, 3]).max() == 0
    result = uncertainty_exponent(found.attractor, 3 ** np.arange(5))
    assert result.dimension == pytest.approx(CANTOR_DIMENSION, abs=0.03)


def test_every_cycle_is_an_attractor_of_its_own_where_nothing_attracts():
    """A turned plane: (x, y) has period 4, and the four states of a cycle share it."""
    grid = Grid((-1, -1), (1, 1), (6, 6))
    found = basins(TURNED, grid, 24)
    assert len(found.names) == 9
    assert found.names[0] == "period 4 a"
    assert np.array_equal(found.attractor, np.rot90(found.attractor))


def test_cell_mapping_of_newton_and_of_a_turned_plane():
    """Hsu's cells agree with the motions where cells are small against basins."""
    grid = Grid((-2, -2), (2, 2), (42, 41))
    cells = cell_mapping(SQUARE_ROOT, grid)
    x = grid.centres(0)
    # the cells around the two roots, which are centres of cells
    left, right = cells.group[[10, 31], 20]
    assert left != right and cells.period[10, 20] == cells.period[31, 20] == 1
    agree = np.where(x[:, None] < 0, cells.group == left, cells.group == right)
    # close to the boundary, what a cell does is not what all of its states do
    assert np.all(agree[np.abs(x) > 0.5]) and agree.mean() > 0.9
    turning = cell_mapping(TURNED, Grid((-1, -1), (1, 1), (6, 6)))
    assert np.all(turning.period == 4) and np.all(turning.cyclic)
    assert len(np.unique(turning.group)) == 9 and np.all(turning.steps == 0)


def test_cells_by_hand():
    """0 -> 1 -> 2 -> 1, 3 -> sink, 4 -> 4, 5 -> 3."""
    found = follow_cells([1, 2, 1, -1, 4, 3], (6,))
    assert found.group.tolist() == [0, 0, 0, -1, 1, -1]
    assert found.period.tolist() == [2, 2, 2, 0, 1, 0]
    assert found.steps.tolist() == [1, 0, 0, 1, 0, 2]
    assert found.cyclic.tolist() == [False, True, True, False, True, False]


def test_cascade_of_the_logistic_map():
    """Flips at 3 and 1 + sqrt(6); at 2.5 the fixed point 1 - 1/mu."""
    values = [2.5, 2.95, 3.05, 3.44, 3.46, 3.54, 3.9]
    found = diagram(LOGISTIC, lambda p: p["mu"], values, [0.3], turns=2000, keep=64)
    wanted = ["period 1"] * 2 + ["period 2"] * 2 + ["period 4"] * 2 + ["aperiodic"]
    assert found.labels[:, 0].tolist() == wanted and 1 + np.sqrt(6) < 3.46
    assert found.states[0] == pytest.approx(1 - 1 / 2.5, abs=1e-12)
    assert found.parameter == "mu"
    assert [r.label for r in found.ranges()] == [
        "period 1", "period 2", "period 4", "aperiodic"
    ]  # fmt: skip


def test_the_parameter_of_a_map_is_chosen_by_its_name():
    """As for a section of a system; the fixed point is 1 - 1/mu."""
    values = np.array([2.5, 2.9])
    starts = np.full((2, 1), 0.3)
    found = LOGISTIC.sample(starts, 400, 1, where="mu", values=values)
    assert found.states[:, 0, 0] == pytest.approx(1 - 1 / values, abs=1e-12)


def test_random_starts_do_not_depend_on_how_many_follow():
    few = monte_carlo([0, 1], [1, 3], 4, seed=3, points=2)
    many = monte_carlo([0, 1], [1, 3], 4, seed=3, points=5)
    assert np.array_equal(few, many[:2])
    assert few.min(axis=(0, 1))[1] >= 1 and few.shape == (2, 4, 2)


@pytest.mark.parametrize(
    ("grid", "word"),
    [
        (((0,), (1, 2), (3,)), "one in each"),
        (((0,), (np.inf,), (3,)), "finite"),
        (((1,), (0,), (3,)), "low below high"),
        (((0,), (1,), (0,)), "1 or"),
    ],
)
def test_a_grid_says_what_is_wrong(grid, word):
    with pytest.raises(ValueError, match=word):
        Grid(*grid)
