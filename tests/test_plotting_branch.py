"""The bifurcation figure says what the branch says."""

import dataclasses
from types import SimpleNamespace

import matplotlib


matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import pytest

from continuation import Branch, Point
from jaxcam import plotting
from jaxcam.plotting._branch_lines import lines_of, stability_between


pytestmark = pytest.mark.filterwarnings("error")


def parabola(number=41, converged=True):
    """x^2 = p, stable above, with its fold."""
    states = np.linspace(1.0, -1.0, number)
    points = [
        Point(
            label=k + 1,
            kind="fold" if x == 0 else "regular",
            parameter=x * x,
            state=np.array([x]),
            multipliers=np.array([1 - x / 2 + 0j]),
            stable=None if x == 0 else bool(x > 0),
            tangent=np.array([1.0, 0.0]),
            scale=np.ones(2),
            step=0.05,
            arclength=1 - x,
            iterations=2,
            converged=bool(converged or x != 0),
        )
        for k, x in enumerate(states)
    ]
    return Branch(tuple(points), "p", (0.0, 1.0))


def test_stable_solid_unstable_dashed_special_marked():
    figure = plotting.branch_diagram(
        parabola(), x_label=("speed", "rpm"), y_label=("angle", "rad"), x_scale=10.0
    )
    (ax,) = figure.axes
    assert ax.get_xlabel() == "speed (rpm)" and ax.get_ylabel() == "angle (rad)"
    lines = {line.get_label(): line for line in ax.lines}
    assert set(lines) == {"stable", "unstable", "fold"}
    assert lines["stable"].get_linestyle() == "-"
    assert lines["unstable"].get_linestyle() == "--"
    for label, sign in (("stable", 1), ("unstable", -1)):
        x, y = lines[label].get_data()
        np.testing.assert_allclose(x, 10 * y**2, atol=1e-12)
        # the lines meet: the first point belongs to the other part
        assert np.all(sign * y[1:] >= -1e-12)
    np.testing.assert_allclose(lines["fold"].get_data(), [[0.0], [0.0]], atol=1e-12)
    assert [text.get_text() for text in ax.texts] == ["fold"]
    legend = ax.get_legend()
    assert {t.get_text() for t in legend.get_texts()} == {"stable", "unstable", "fold"}
    plt.close(figure)


def test_point_that_was_only_bracketed_is_named_so():
    figure = plotting.branch_diagram(parabola(converged=False), letters=False)
    labels = {line.get_label() for line in figure.axes[0].lines}
    assert "fold (bracketed)" in labels and not figure.axes[0].texts
    plt.close(figure)


@pytest.mark.parametrize("side, expected", [(1, "left"), (-1, "right")])
def test_the_name_of_a_mark_at_an_edge_is_written_inwards(side, expected):
    branch = parabola()
    points = [
        dataclasses.replace(p, parameter=100 + side * p.parameter)
        for p in branch.points
    ]
    figure = plotting.branch_diagram(Branch(tuple(points), "p", (99.0, 101.0)))
    (text,) = figure.axes[0].texts
    assert text.get_ha() == expected
    plt.close(figure)


def points_of(*rows):
    """Points of these kinds and stabilities, one unit of arclength apart."""
    return [
        SimpleNamespace(
            special=kind not in ("start", "regular", "end"),
            stable=stable,
            parameter=float(k),
            arclength=float(k),
        )
        for k, (kind, stable) in enumerate(rows)
    ]


def test_the_stability_of_a_line_is_that_of_the_points_inside_it():
    """Special points carry none; a part without other points has that before it."""
    points = points_of(
        ("start", True),
        ("grazing", None),
        ("regular", False),
        ("flip", None),
        ("regular", True),
        ("fold", None),
        ("grazing", None),
        ("end", False),
    )
    found = stability_between(points)
    assert found == [True, False, False, True, True, True, False]
    lines = lines_of(points, [np.zeros(1)] * 8)
    assert [line.stable for line in lines] == [True, False, True, True, False]
    assert [line.parameters[-1] for line in lines] == [1, 3, 5, 6, 7]


def test_a_branch_without_stability_is_solid_and_unnamed():
    points = points_of(("start", None), ("regular", None), ("end", None))
    (line,) = lines_of(points, [np.zeros(1)] * 3)
    assert line.stable is None


def test_a_line_is_a_smooth_curve_through_its_points():
    """A quarter of a circle in chords of 15 degrees: radius to a tenth of their sag."""
    angles = np.linspace(0.0, np.pi / 2, 7)
    points = [
        SimpleNamespace(
            special=False, stable=True, parameter=np.cos(one), arclength=one
        )
        for one in angles
    ]
    (line,) = lines_of(points, [np.array([np.sin(one)]) for one in angles])
    radius = np.hypot(line.parameters, line.values[:, 0])
    sag = 1 - np.cos(angles[1] / 2)
    assert np.max(np.abs(radius - 1)) < 0.1 * sag
    for point in points:
        assert np.min(np.abs(line.parameters - point.parameter)) < 1e-12


def test_labels_cover_no_line_and_no_marker():
    """Boxes of the labels against the pixels of all lines, for a branch with an S."""
    states = np.linspace(-1.6, 1.6, 65)
    points = [
        Point(
            label=k + 1,
            kind="fold" if abs(abs(x) - 1) < 1e-9 else "regular",
            parameter=x**3 - 3 * x,
            state=np.array([x]),
            multipliers=np.ones(1, complex),
            stable=None if abs(abs(x) - 1) < 1e-9 else bool(abs(x) > 1),
            tangent=np.array([1.0, 0.0]),
            scale=np.ones(2),
            step=0.05,
            arclength=x,
            iterations=2,
            converged=True,
        )
        for k, x in enumerate(states)
    ]
    figure = plotting.branch_diagram(Branch(tuple(points), "p", (-3.0, 3.0)))
    (ax,) = figure.axes
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in ax.texts if text.get_text()]
    assert len(boxes) == 2
    for line in ax.lines:
        rows = line.get_transform().transform(line.get_xydata())
        for box in boxes:
            assert not np.any([box.contains(*row) for row in rows])
    plt.close(figure)
