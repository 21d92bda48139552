"""Results print as short tables, as text and as HTML."""

from types import SimpleNamespace

import jax
import numpy as np
import pytest

import jaxcam
from continuation import Branch, Point
from jaxcam import sweeps
from jaxcam.discrepancy import Diagnosis
from jaxcam.discrepancy.report import Effect
from jaxcam.discrepancy.terms import Value
from jaxcam.fitting._fit_result import Fit
from jaxcam.hybrid import stroboscope
from jaxcam.models import BouncingBall, ImpactOscillator
from jaxcam.tables import ShortTable


def point(label, kind, parameter, stable=True, **other):
    return Point(
        label=label,
        kind=kind,
        parameter=parameter,
        state=np.zeros(2),
        multipliers=np.zeros(2, complex),
        stable=stable,
        tangent=np.zeros(3),
        scale=np.ones(3),
        step=0.1,
        arclength=0.0,
        iterations=1,
        converged=other.pop("converged", True),
        **other,
    )


def test_columns_have_one_width_and_numbers_stand_to_the_right():
    table = ShortTable("Two.", ("name", "n"), [("a", "1"), ("long", "10")], ("name",))
    assert table.text() == "Two.\nname   n\na      1\nlong  10"


def test_html_is_escaped_and_a_table():
    page = ShortTable("a < b", ("x",), [("<1",)]).html()
    assert "a &lt; b" in page and "&lt;1" in page and page.count("<tr>") == 2


def test_of_many_rows_the_ends_are_shown():
    table = ShortTable("Many.", ("k",), [(str(k),) for k in range(1000)])
    lines = table.text().splitlines()
    assert len(lines) == 2 + 21 and lines[2].strip() == "0"
    assert lines[12].strip() == "…" and lines[-1].strip() == "999"


def test_a_branch_prints_its_ends_and_special_points():
    points = [point(1, "start", 0.0)]
    points += [point(k, "regular", 0.1 * k) for k in range(2, 60)]
    points += [
        point(60, "fold", 6.0, criticality="the branch lies at smaller parameters"),
        point(61, "grazing", 6.1, converged=False),
        point(62, "end", 7.0, stable=False, reason="speed is at its bound 7"),
    ]
    branch = Branch(tuple(points), "speed", (0.0, 7.0))
    text = str(branch)
    assert text == repr(branch)
    assert "62 points, 2 of them special" in text
    assert len(text.splitlines()) == 2 + 4
    assert "the branch lies at smaller" in text and "not converged" in text
    assert "unstable" in text.splitlines()[-1]
    assert branch._repr_html_().count("<tr>") == 1 + 4
    assert len(str(points[59]).splitlines()) == 1
    assert str(points[-1]) == "Point 62: end at 7, unstable, speed is at its bound 7"


def test_a_diagnosis_prints_its_effects():
    drag = Effect(
        name="air_drag", sentence="air",
        parameters={"c": Value(0.12, 0.01, "1/m")},
        where="flight", region="fast", records=("a",),
        delta_bic=-250.0, heldout_gain_nats=120.0, inclusion=1.0,
    )  # fmt: skip
    fields = SimpleNamespace(case="swing", summary="Air drags.", effects=(drag,))
    text = Diagnosis._table(fields).text()  # pyright: ignore
    assert text.splitlines()[0] == "swing: Air drags."
    assert "air drag  c = 0.12 +- 0.01 1/m  flight" in text and "-250" in text


@pytest.mark.parametrize("kind", [Fit, Branch, Point, Diagnosis])
def test_no_result_prints_its_arrays(kind):
    """The representation that a dataclass writes would show every array."""
    assert "dataclasses" not in kind.__repr__.__module__
    assert kind.__repr__.__qualname__ == f"{kind.__name__}.__repr__"


@pytest.fixture(scope="module")
def bounced():
    return jaxcam.simulate(BouncingBall(), [1.0, 0.0], 0.0, 5.0)


def test_the_parts_of_a_trajectory_print_as_tables(bounced):
    lines = str(bounced.impacts).splitlines()
    assert lines[0] == f"impacts: {int(bounced.impacts.count)}"
    assert lines[2].split() == ["1", "0.45152364", "0", "4.42945", "3.54356"]
    assert len(lines) == 2 + 21 and bounced.impacts._repr_html_().count("<tr>") == 22
    # the ball comes to rest and stays
    assert str(bounced.contacts).splitlines()[-1].split() == [
        "1", "4.0637128", "5", "0", "no",
    ]  # fmt: skip
    lines = str(bounced.steps).splitlines()
    assert lines[0] == f"integration points: {int(bounced.steps.count)}"
    assert lines[2].split() == ["1", "0", "1,", "0", "-"]
    assert lines[-1].split()[-1] == "0"


def test_a_batch_and_traced_results_print_as_modules(bounced):
    batch = jax.tree.map(lambda x: np.stack([x, x]), bounced)
    for part in (batch, batch.impacts, batch.contacts, batch.steps):
        assert str(part) == repr(part) and part._repr_html_() is None
    seen = []
    jax.jit(lambda part: seen.append((str(part), part._repr_html_())))(bounced.impacts)
    assert "Impacts(" in seen[0][0] and seen[0][1] is None


def test_a_stroboscope_prints_a_row_for_each_trajectory():
    found = stroboscope(ImpactOscillator(), np.zeros((2, 2)), 4, skip=2)
    lines = str(found).splitlines()
    assert lines[0] == "trajectories: 2, failed: 0, samples of each: 2"
    assert lines[1].split()[-1] == "sample" and len(lines) == 4


def test_sweeps_print_the_labels_of_their_motions():
    logistic = sweeps.Map(lambda x, p: p["mu"] * x * (1 - x), {"mu": 3.2})
    made = sweeps.diagram(logistic, "mu", [2.7, 2.8, 3.2], [0.3], keep=16)
    lines = str(made).splitlines()
    assert lines[0] == "Diagram of mu: 3 values, 1 start, 16 samples of each motion."
    assert lines[1].split() == ["motion", "lowest", "mu", "highest", "mu"]
    assert [line.split()[-2:] for line in lines[2:]] == [["2.7", "2.8"], ["3.2", "3.2"]]
    assert made._repr_html_().count("<tr>") == 3

    cubic = sweeps.Map(lambda x, p: 1.5 * x - 0.5 * x**3)
    lines = str(sweeps.basins(cubic, sweeps.Grid([-1.0], [1.0], [10]))).splitlines()
    assert lines[0] == "Basins of 2 attractors, 10 states."
    assert len(lines) == 4 and all("50.0%" in line for line in lines[2:])

    parts = lambda x, p: p["a"] + p["b"] * x - x**2
    quadratic = sweeps.Map(parts, {"a": 0.0, "b": 0.5})
    chart = sweeps.chart(quadratic, ("a", "b"), [0.0, 0.1], [0.4, 0.5], [0.1])
    lines = str(chart).splitlines()
    assert lines[0] == "Chart of a (2 values) and b (2 values)."
    assert lines[2].split()[-1] == "100.0%" and len(lines) == 3
