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
from jaxcam.plotting._branch import _solid


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
            stable=bool(x > 0),
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


def test_a_point_of_unknown_stability_belongs_to_the_line_beside_it():
    """Between unstable points and a change of the problem, the line is dashed."""
    kinds = [
        ("5 impacts", True),
        ("5 impacts", None),
        ("5 impacts", False),
        ("5 impacts", None),
        ("6 impacts", None),
        ("6 impacts", False),
        ("7 impacts", None),
    ]
    points = [SimpleNamespace(signature=s, stable=stable) for s, stable in kinds]
    assert _solid(points) == [True, True, False, False, False, False, True]
