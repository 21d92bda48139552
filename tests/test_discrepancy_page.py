"""The report of a diagnosis: complete in itself, the sentence first."""

import dataclasses
from types import SimpleNamespace
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.text import Text
from PIL import Image

from jaxcam.cli import write_report
from jaxcam.cli._diagnosis_figures import _maps, _unseen, draw
from jaxcam.cli._diagnosis_page import _knockoffs, diagnosis_page
from jaxcam.cli._outlook import Outlook
from jaxcam.cli._output import to_text
from jaxcam.cli._page import prose
from jaxcam.cli._ranking_figure import ranking, two_lines
from jaxcam.cli._shapes_figure import caption, shapes as draw_shapes
from jaxcam.discrepancy import Diagnosis, Verdict
from jaxcam.discrepancy.evidence import Structure
from jaxcam.discrepancy.report import (
    Alternative,
    Caveat,
    Effect,
    MissingFunction,
    Reason,
    spelled,
)
from jaxcam.discrepancy.report._alternatives import _not_added, explains_less
from jaxcam.discrepancy.terms import shapes, unit_along, Value, Variable
from jaxcam.fitting import Residuals


def _residuals(name):
    rng = np.random.default_rng(1)
    time = 5e-4 * np.arange(400)
    value = 1e-4 * rng.standard_normal(400)
    rest = time > 0.15
    return Residuals(name, "q", time, 15 * time, value, 0 * time, rest, 1e-4)


def _diagnosis(verdict, effects):
    grid = np.linspace(0.1, 0.4, 8)
    shape = Structure(
        "force_of_position",
        "a force that depends on the position",
        "flight",
        "in flight",
        3.0,
        60.0,
        6,
        "rad/s^2",
        "position",
        grid,
        0.1 * grid,
        0.1 + 0 * grid,
        quantity="force",
        argument_unit="rad",
    )
    parts = [_residuals("run1"), _residuals("run2")]
    return Diagnosis(
        case="case",
        verdict=Verdict(verdict),
        effects=effects,
        alternatives=(
            Alternative("coulomb_friction", 55.0, ("coulomb_friction",)),
            Alternative("none", 2000.0, ()),
        ),
        heldout_before=2e-4,
        heldout_after=1e-4,
        noise_floor=1e-4,
        unit="rad",
        rig={"K/J": Value(2401.04, 0.21, "1/(m^2 s^2)")},
        summary="The model lacks damping. Without it <nothing> fits.",
        before=None,  # pyright: ignore
        after=None,  # pyright: ignore
        left_before=(shape,),
        left_after=(shape,),
        unseen=(parts, parts),
        ripple=None,
        pulls={"K/J": (1.3, 0.2)},
        limits={"fc": Value(0.01, 0.003, "rad/s^2")},
        hides={"fc": "restitution"},
        caveats=(Caveat(Reason.TIE, "One caveat."),),
    )


FUNCTIONS = (
    MissingFunction(
        "force",
        ("position",),
        (np.linspace(0.2, 0.4, 9),),
        -np.linspace(0.0, 2.0, 9),
        np.full(9, 0.1),
        "rad/s^2",
        "a force that depends on the position",
        ("run1",),
    ),
    MissingFunction(
        "force",
        ("position", "velocity"),
        (np.linspace(0.2, 0.4, 9), np.linspace(-1.0, 1.0, 5)),
        np.outer(np.ones(9), np.linspace(-1.0, 1.0, 5)),
        np.full((9, 5), 0.1),
        "rad/s^2",
        "damping that depends on the position",
        ("run1",),
    ),
)
EFFECT = Effect(
    name="viscous_damping",
    sentence="damping",
    parameters={"c1": Value(0.1, 0.01, "1/s")},
    where="flight",
    region="in flight",
    records=("run1",),
    delta_bic=-100.0,
    heldout_gain_nats=40.0,
    inclusion=1.0,
)


@pytest.mark.parametrize(
    ("verdict", "effects"), [("effect", (EFFECT,)), ("none", ()), ("unknown", ())]
)
@pytest.mark.usefixtures("unchecked_types")
def test_the_page_is_complete(tmp_path, verdict, effects):
    found = _diagnosis(verdict, effects)
    figures = draw(tmp_path, found)
    page = diagnosis_page(found, figures, ("A note.",))
    assert page.index("The model lacks damping.") < page.index("<figure>")
    assert "&lt;nothing&gt;" in page
    # a correction that is not significant does not show the missing effect
    assert page.count("data:image/png;base64,") == (3 if effects else 4)
    # nothing is loaded from elsewhere
    assert "http" not in page.replace("http-equiv", "")
    assert "One caveat." in page
    assert ("viscous damping" in page) == bool(effects)
    # a limit is that of an effect, and errors have the unit of the figures
    assert "<td class=text>Coulomb friction</td><td class=text>fc</td>" in page
    assert "is 0.2 mrad with the textbook model" in page
    # letters are equally large in all figures: a picture is as wide as it was drawn
    for file, _ in figures:
        with Image.open(file) as image:
            inches = image.width / image.info["dpi"][0]
        assert f'<img width="{96 * inches:.0f}"' in page
    assert '"verdict"' in to_text(found.to_json())
    # the value of a parameter has all its digits and a unit
    assert "<td>2401 ± 0.2 1/(m<sup>2</sup> s<sup>2</sup>)</td>" in page, page
    assert ("per unit mass" in page) == bool(effects)


@pytest.mark.usefixtures("unchecked_types")
def test_the_page_says_why_nothing_is_predicted(tmp_path):
    found = _diagnosis("none", ())
    outlook = Outlook(reason="No speeds are predicted for an unknown effect.")
    assert "for an unknown effect" in diagnosis_page(found, (), (), outlook)


@pytest.mark.usefixtures("unchecked_types")
def test_functions_without_a_name_are_drawn_and_written(tmp_path):
    found = dataclasses.replace(_diagnosis("unknown", ()), missing=FUNCTIONS)
    page = diagnosis_page(found, draw(tmp_path, found), ())
    assert page.count("data:image/png;base64,") == 4
    first, second = found.to_json()["missing"]
    assert first["arguments"] == ["position"]
    assert len(first["table"]["value"]) == len(first["table"]["position"]) == 9
    assert [len(row) for row in second["table"]["value"]] == [5] * 9
    assert second["kind"] == "force"


@pytest.mark.usefixtures("unchecked_types")
def test_shapes_are_drawn_with_units_on_both_axes():
    figure = draw_shapes(plt, _diagnosis("none", ()))
    axes = figure.axes[0]
    assert axes.get_xlabel() == "position (rad)"
    assert axes.get_ylabel() == "force (rad/s²)"
    plt.close(figure)


@pytest.mark.usefixtures("unchecked_types")
def test_a_model_that_is_not_changed_has_no_panel_with_effects():
    """One panel of residuals per kind, and no label that names missing effects."""
    for effects, panels in (((), 1), ((EFFECT,), 2)):
        found = _diagnosis("effect" if effects else "none", effects)
        figures = [_unseen(plt, found), _maps(plt, found), draw_shapes(plt, found)]
        words = [text.get_text() for one in figures for text in one.findobj(Text)]
        assert any("missing effects" in word for word in words) == bool(effects)
        assert len(figures[0].axes) == panels
        assert ("missing effects" in diagnosis_page(found, (), ())) == bool(effects)
        plt.close("all")


@pytest.mark.usefixtures("unchecked_types")
def test_residuals_are_seen_before_and_after():
    """A residual one hundredth as large has its own range, and fills half of it; the
    recording is that with the median improvement; colours reach the largest mean.
    """
    found = _diagnosis("effect", (EFFECT,))
    after, *_ = found.unseen[1]
    sizes, names = (100.0, 1.0, 3000.0), ("run1", "run2", "run3")
    before = [
        dataclasses.replace(after, record=name, value=size * after.value)
        for size, name in zip(sizes, names, strict=True)
    ]
    same = [dataclasses.replace(after, record=name) for name in names]
    found = dataclasses.replace(found, unseen=(before, same))
    figure, maps = _unseen(plt, found), _maps(plt, found)
    first, second = figure.axes
    assert first.get_title().startswith("run1")
    largest = np.max(np.abs(after.value))
    for axis, most in ((first, 100 * largest), (second, largest)):
        assert most < axis.get_ylim()[1] < 2 * most
    image = maps.axes[0].images[0]
    assert image.norm.vmax == pytest.approx(np.nanmax(np.abs(image.get_array())))
    assert image.norm.vmax > 100
    plt.close("all")


@pytest.mark.usefixtures("unchecked_types")
def test_only_significant_shapes_are_drawn():
    """At most four, or the largest one and the statement that it is not significant."""
    found = _diagnosis("effect", (EFFECT,))
    (small,) = found.left_after
    assert "not significant" in caption(found)
    gains = (70.0, 50.0, 80.0, 90.0, 65.0, 100.0)
    many = tuple(dataclasses.replace(small, gain=gain) for gain in gains)
    for left, drawn in ((many, 4), (many[:3], 2), ((small, many[1]), 1)):
        one = dataclasses.replace(found, left_after=left)
        figure = draw_shapes(plt, one)
        titles = [axis.get_title() for axis in figure.axes if axis.axison]
        assert len(titles) == drawn
        assert all(title.startswith("significant") for title in titles) == (drawn > 1)
        plt.close(figure)


@pytest.mark.usefixtures("unchecked_types")
def test_the_correction_shown_is_one_of_the_missing_effect():
    """If the effects leave nothing significant, the correction of the textbook model in
    the part of the motion in which they act, not the largest remainder.
    """
    found = _diagnosis("effect", (EFFECT,))
    (small,) = found.left_after
    drift = dataclasses.replace(small, name="drift", where="impact", variable="time")
    found = dataclasses.replace(
        found,
        left_before=(
            dataclasses.replace(small, gain=900.0),
            dataclasses.replace(drift, gain=2000.0),
        ),
        left_after=(small, dataclasses.replace(drift, gain=20.0)),
    )
    figure = draw_shapes(plt, found)
    (axis,) = figure.axes
    assert axis.get_xlabel() == "position (rad)"
    assert caption(found).startswith("No correction of the model with the missing")
    plt.close(figure)


@pytest.mark.usefixtures("unchecked_types")
def test_the_ranking_separates_better_and_worse_explanations():
    """Bars on both sides of zero; a better one states why it was not named."""
    better = Alternative("sensor_lag", -2.8e5, ("sensor_lag",), "gains, but doubtful")
    found = _diagnosis("effect", (EFFECT,))
    found = dataclasses.replace(found, alternatives=(better, *found.alternatives))
    figure = ranking(plt, found)
    (axis,) = figure.axes
    (bars,) = zip(*axis.containers, strict=True)
    assert [bar.get_width() for bar in bars] == [-2.8e5, 55.0, 2000.0]
    low, high = axis.get_xlim()
    assert low < -2.8e5 and 2000.0 < high
    assert bars[0].get_facecolor() != bars[1].get_facecolor()
    notes = [one.get_text() for one in axis.texts if "not named" in one.get_text()]
    assert notes == ["not named: doubtful"]
    plt.close(figure)


def test_an_addition_that_fits_better_states_why_it_is_not_named():
    doubtful = _not_added(50.0, 10.0, 1, True, True)
    assert "required), but the term is doubtful" in doubtful
    assert "but the bootstrap tests only" in _not_added(50.0, 10.0, 1, True, False)
    assert "but this is a prediction" in _not_added(50.0, 10.0, 1, False, False)


def test_a_term_that_is_not_significant_states_its_size_and_the_size_required():
    """With one strength, the gain is the square of its significance."""
    one = _not_added(1.44, 9.0, 1, False, False)
    assert "its strength is 1.2 standard errors, and 3 are required" in one
    # a strength of the wrong sign is zero
    assert "is 0 standard errors" in _not_added(-0.5, 9.0, 1, False, False)
    three = _not_added(6.88, 30.1, 3, True, False)
    assert "by 6.88, and 30.1 is required for 3 parameters" in three


@pytest.mark.usefixtures("unchecked_types")
def test_an_explanation_that_explains_less_states_its_share_of_the_misfit():
    """Of the costs 500 to 100 of 100 samples, one that leaves 400 explains 25 %."""

    def fit(cost, free=("a", "b")) -> Any:
        problem = SimpleNamespace(samples=100)
        return SimpleNamespace(cost=cost, problem=problem, free=free)

    textbook, best = fit(500.0), fit(100.0)
    for cost, words in ((400.0, "25.0%"), (499.9, "none")):
        reason = explains_less(textbook, fit(cost), best)
        assert reason.startswith(f"explains {words} of what the verdict explains")
    for cost in (100.1, 95.0):
        more = explains_less(textbook, fit(cost, ("a", "b", "c")), best)
        assert more.startswith("explains as much, but with more parameters (1): ")
        same = explains_less(textbook, fit(cost), best)
        assert same.startswith("explains as much, but with a larger BIC: ")
    half = explains_less(textbook, fit(400.0), best)
    assert half.endswith("its residual is 2 times the noise, that of the verdict 1")


@pytest.mark.usefixtures("unchecked_types")
def test_each_effect_has_its_own_gain():
    """The residual if it alone is removed, and one gain for all effects together."""
    other = dataclasses.replace(EFFECT, name="coulomb_friction", rms_without=1.37)
    fit: Any = SimpleNamespace(cost=98.0, problem=SimpleNamespace(samples=100))
    found = _diagnosis("effect", (dataclasses.replace(EFFECT, rms_without=4.2), other))
    page = diagnosis_page(dataclasses.replace(found, after=fit), (), ())
    assert ">4.2</td>" in page and ">1.37</td>" in page
    assert "it is 0.99 with all effects" in page
    assert "log-likelihood of held-out data by 40" in page
    assert other.to_json()["evidence"]["rms_without"] == 1.37


def test_every_shape_has_a_quantity_whose_unit_is_known():
    offered = shapes((0.2, 0.4), (-1.0, 1.0), (0.0, 2.0), (0.0, 4.0))
    assert {one.variable for one in offered} == set(Variable)
    units = {Variable(one.variable): unit_along(one.variable, "m") for one in offered}
    assert units == {
        Variable.POSITION: "m",
        Variable.VELOCITY: "m/s",
        Variable.APPROACH: "m/s",
        Variable.PHASE: "rad",
        Variable.TIME: "s",
    }


def test_a_report_is_written_from_python(tmp_path, monkeypatch, unchecked_types):
    """By the function of the command, into a folder given as text."""
    written = []
    monkeypatch.setattr(
        "jaxcam.cli._diagnose_files.write_diagnosis",
        lambda folder, found, notes: written.append((folder, found, notes)),
    )
    page = write_report("a diagnosis", str(tmp_path / "report"))  # pyright: ignore
    assert page == tmp_path / "report" / "index.html"
    assert written == [(tmp_path / "report", "a diagnosis", ())]


def test_names_with_formulas_are_spelled_as_they_are():
    """Terms are joined by a plus sign; those in formulas and numbers stay."""
    assert spelled("coulomb_friction+sensor_lag") == "Coulomb friction + sensor lag"
    # of a system that has no cam, too
    assert spelled("cam_profile_error") == "profile error"
    assert (
        spelled("force 1e+05*max(x - 2, 0) + 3*x") == "force 1e+05*max(x - 2, 0) + 3*x"
    )


def test_a_long_label_has_two_lines():
    waves = [f"0.{k}*cos({k}*phase - 0.5)" for k in range(1, 5)]
    words = f"force {' + '.join(waves)}"
    first, second = two_lines(words).splitlines()
    assert words.startswith(first) and second.endswith(" …")
    assert two_lines("sensor lag") == "sensor lag"


def test_the_page_compares_an_unnamed_force_with_its_knockoffs(unchecked_types):
    """It gives their number and the share of the best one; a restitution has none."""
    grid = (np.linspace(0.0, 1.0, 3),)
    table = (grid, np.zeros(3), np.ones(3), "rad/s^2", "words", ("run1",))
    force = MissingFunction("force", ("position",), *table, knockoffs=(19, 0.034))
    bounce = MissingFunction("restitution", ("speed",), *table)
    assert force.to_json()["knockoffs"] == {"tried": 19, "best": 0.034}
    assert bounce.to_json()["knockoffs"] is None
    found = dataclasses.replace(_diagnosis("unknown", ()), missing=(force, bounce))
    (says,) = _knockoffs(found)
    assert "19 functions" in says and "3.4%" in says


def test_signs_and_powers_are_typeset_on_a_page():
    assert prose("c = 2 +- 0.1 m/s^2 < 3") == "c = 2 ± 0.1 m/s<sup>2</sup> &lt; 3"
