"""Chapters 2, 3, 5 and 6 beside their printed numbers: labels, diagrams, theory."""

from types import SimpleNamespace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.models import preset, rpm_to_rad_s
from jaxcam.thesis import reproduce, TARGETS
from jaxcam.thesis.chapter_2_dynamical_systems.figure_2_14 import (
    grazing_in_closed_form,
    sliding_events,
)
from jaxcam.thesis.chapter_5_bifurcations import figure_5_11
from jaxcam.thesis.motions import MotionTarget
from jaxcam.thesis.remember import remembered
from jaxcam.thesis.target import frame


@pytest.fixture(scope="module")
def calibrated():
    return preset("calibrated")


def found(name, system):
    return reproduce(name, system).set_index("quantity")


def test_every_figure_of_the_list_is_a_target():
    """Figures that show data of the model; sketches and photographs are left out."""
    chapters = {
        5: set(range(1, 29)) - {13},
        6: {2, 3, 4, 5, 6, 7, 9, 10, 11, 12, 14, 15, 16},
        4: set(range(13, 25)),
        3: {8, 9, 11, 12},
        1: {2, 3},
    }
    wanted = {f"figure-{n}.{k}" for n, these in chapters.items() for k in these}
    tables = {f"table-{n}" for n in ("4.4", "5.1", "5.2", "5.3")}
    tables |= {f"table-6.{k}" for k in range(1, 5)}
    assert wanted | tables <= set(TARGETS)
    for name, target in TARGETS.items():
        assert (target.draw is not None) == name.startswith("figure"), name


def test_relative_difference_is_over_what_is_printed():
    table = frame([("a", -2.0, -2.1, ""), ("b", 0.0, 0.1, ""), ("c", 0.0, 0.0, "")])
    np.testing.assert_allclose(table["relative"], [-0.05, np.nan, 0.0])


def test_results_are_kept_by_the_values_of_the_parameters(calibrated):
    calls = []

    @remembered
    def slow(system, size):
        calls.append(size)
        return float(system.speed)

    faster = eqx.tree_at(lambda s: s.speed, calibrated, jnp.asarray(20.0))
    again = eqx.tree_at(lambda s: s.speed, calibrated, jnp.asarray(20.0))
    values = [slow(faster, "a"), slow(again, "a"), slow(faster, "b")]
    assert values == [20.0] * 3 and calls == ["a", "b"]
    assert slow(calibrated, "a") != 20.0


def test_a_run_that_failed_is_no_end_of_sticking(monkeypatch, calibrated):
    """Of Figure 5.11: beside P(inf,1), its speed is neither before nor behind it."""
    speeds = rpm_to_rad_s(np.linspace(152.6, 152.7, 6))
    labels = ["P(inf,1)", "P(inf,1)", "failed", "P(25,1)", "aperiodic", "failed"]
    made = SimpleNamespace(values=speeds, labels=np.array(labels)[:, None])
    monkeypatch.setattr(figure_5_11, "onset", lambda system, size: made)
    end = SimpleNamespace(speed=speeds[3])
    monkeypatch.setattr(figure_5_11, "interruption", lambda system: end)
    table = figure_5_11.TARGET.table(calibrated, "default")
    computed = table.set_index("quantity")["computed"]
    assert computed["first speed without P(inf,1)"] == pytest.approx(152.66)
    assert computed["fraction of the speeds above it with a periodic motion"] == 0.5
    assert computed["speeds at which the run failed"] == 2


@pytest.mark.slow
@pytest.mark.parametrize(
    "target",
    [
        name
        for name, target in TARGETS.items()
        if isinstance(target, MotionTarget) and name.startswith("figure-5")
    ],
)
def test_motions_are_what_the_thesis_names(target, calibrated):
    """Turns, impacts and rests of each; chaos at 154.1 rpm may be one of its windows.

    A window is an orbit that rests, several turns long.
    """
    table = found(target, calibrated)
    for name, row in table.iterrows():
        if "aperiodic" in str(name):
            assert row["computed"] == 0 or row["computed"] > 4
        else:
            assert row["computed"] == row["printed"]


@pytest.mark.slow
def test_table_5_1_comes_out_of_the_diagram(calibrated):
    """Every speed but the end of P(2,2) within 1 rpm, four steps of the diagram."""
    table = found("table-5.1", calibrated)
    compared = table.drop(index="P(2,2) and its doublings, to").dropna()
    assert len(compared) == 9
    assert np.max(np.abs(compared["difference"])) <= 1.0


@pytest.mark.slow
def test_experiment_of_section_4_7_meets_the_events_of_the_model(calibrated):
    """Table 5.1, simulated column, within the 0.5 rpm between speeds and its rounding.

    Neither end of the sweeps counts: the way down ends at 150 rpm, above the fold of
    P(1,1), and the printed end of P(2,2) is that of a diagram.
    """
    table = found("figure-4.17", calibrated)
    model = table.filter(like="printed for the model", axis=0)["difference"].abs()
    assert len(model) == 9
    outside = model.index.str.startswith(("P(1,1), from", "P(2,2) and its"))
    assert model[~outside].max() <= 0.5 + 1e-9
    rig = table.filter(like="printed for the rig", axis=0)["difference"].abs()
    assert rig["P(1,1), to; printed for the rig"] > 30
    stored = found("figure-4.18", calibrated).filter(like="shortest time", axis=0)
    assert np.all(stored["computed"].between(9.5, 10.0))


@pytest.mark.slow
@pytest.mark.parametrize(("rig", "stiffer"), [("table-4.4", 1.0), ("calibrated", 1.25)])
def test_figures_around_the_interruption_of_another_rig(rig, stiffer):
    """Sticking in the last turn below it and none above, wherever that is.

    Table 4.4 has another phase, in which time zero is in contact; a stiffer spring is
    interrupted 11 rpm further on.
    """
    other = preset(rig)
    other = eqx.tree_at(lambda s: s.stiffness, other, stiffer * other.stiffness)
    rows = found("figure-1.3", other)["computed"]
    assert abs(rows["interruption"] - 152.67658) > 2
    below, above = rows.iloc[1:]
    assert below > 1e-3 and above == 0
    widths = found("figure-5.25", other).filter(like="width", axis=0)["computed"]
    assert len(widths) >= 4 and widths.between(0.4, 0.8).all()


@pytest.mark.slow
def test_onset_and_sticking_time(calibrated):
    """Interruption to 0.01 rpm; the sticking time falls with kappa/2, not a root."""
    assert abs(found("figure-5.11", calibrated)["difference"].iloc[0]) < 0.01
    table = found("figure-5.24", calibrated)["computed"]
    measured, theory = table.filter(like="exponent").iloc[0], table.iloc[2]
    assert abs(measured - theory) < 2e-3 and abs(measured - 0.5) > 0.05


@pytest.mark.slow
def test_two_attractors_at_145_rpm_in_their_basins(calibrated):
    table = found("figure-5.14", calibrated)
    assert list(table["difference"].dropna()) == [0.0, 0.0]
    assert table["computed"].filter(like="fraction of").sum() == pytest.approx(1.0)


@pytest.mark.slow
def test_local_map_and_reconstructions(calibrated):
    """Events in the printed order; slopes of Table 6.3 from simulations to 1e-3."""
    assert found("figure-5.26", calibrated)["difference"].dropna().eq(0).all()
    assert abs(found("figure-6.12", calibrated)["relative"].iloc[0]) < 1e-4
    slopes = found("figure-6.15", calibrated)["relative"].dropna()
    assert len(slopes) == 2 and np.max(np.abs(slopes)) < 1e-3


@pytest.mark.slow
def test_branches_through_interruption_and_fold(calibrated):
    sticking = found("figure-3.9", calibrated)["computed"]
    assert abs(sticking["interruption of chatter"] - 152.67658) < 0.04
    fold = found("figure-3.12", calibrated)["computed"]
    assert abs(fold["fold"] - 135.947) < 0.01
    assert fold["saddles followed beyond the fold, to"] > 136.5


@pytest.mark.slow
def test_sliding_begins_where_the_closed_form_says():
    """Grazing-sliding to 1e-6; at the others the field beyond is tangent to 1e-4."""
    events = sliding_events()
    grazing = events["grazing-sliding"].belt
    assert abs(grazing - grazing_in_closed_form()) < 1e-6
    belts = [event.belt for event in events.values()]
    assert belts == sorted(belts, reverse=True)
    for name in ("switching-sliding", "crossing-sliding"):
        assert abs(events[name].beyond) < 1e-4
