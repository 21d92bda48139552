"""Numbers of the thesis' figures, beside what it prints or gives a formula for."""

import numpy as np
import pytest
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.models import preset
from jaxcam.thesis import reproduce


@pytest.fixture(scope="module")
def calibrated():
    return preset("calibrated")


def differences(name, system):
    table = reproduce(name, system)
    return table.set_index("quantity")["difference"].dropna()


@pytest.mark.parametrize(
    ("name", "tolerance"),
    [
        ("figure-2.3", 1e-12),
        ("figure-2.7", 0.0),
        ("figure-2.11", 1e-12),
        ("figure-4.5", 1e-12),
        ("figure-4.15", 5e-12),
    ],
)
def test_figures_with_formulas(name, tolerance, calibrated):
    found = differences(name, calibrated)
    assert len(found) > 0
    assert np.max(np.abs(found)) <= tolerance


def test_ratio_of_figure_2_4(calibrated):
    """4.669 as printed, to its last digit."""
    found = differences("figure-2.4", calibrated)
    assert np.max(np.abs(found[-4:])) < 5e-4


@pytest.mark.slow
def test_zeno_ball_of_figure_2_13(calibrated):
    """Events exactly (2.43); steps with an error that falls as their length does."""
    found = differences("figure-2.13", calibrated)
    assert abs(found["accumulation time, event detection"]) < 1e-12
    assert abs(found["accumulation time, 16000 time steps"]) < 5e-4


@pytest.mark.slow
def test_contact_and_detachment_of_figure_4_14(calibrated):
    """No impact at 110 rpm; detachment at the printed 125 rpm, to its last digit."""
    found = differences("figure-4.14", calibrated)
    assert found["impacts in two turns"] == 0
    assert abs(found["detachment"]) < 0.5


@pytest.mark.slow
def test_interruption_of_figure_1_3(calibrated):
    """Sticking before, none after, and the speed between within 0.04 rpm."""
    table = reproduce("figure-1.3", calibrated).set_index("quantity")
    assert table.loc["sticking time at 152.65 rpm", "computed"] > 1e-3
    assert table.loc["sticking time at 152.69 rpm", "computed"] == 0
    assert abs(table.loc["interruption", "difference"]) < 0.04


@pytest.mark.slow
def test_orbit_of_figures_3_8_and_3_11(calibrated):
    """One impact a turn, closed; fold to 0.01 rpm, flip between rows of Table 5.2."""
    found = differences("figure-3.11", calibrated)
    assert found["impacts in two turns"] == 0
    assert abs(found["closing of the orbit after two turns"]) < 1e-9
    branch = reproduce("figure-3.8", calibrated).set_index("quantity")["computed"]
    assert abs(branch["fold"] - 135.947) < 0.01
    assert 151.8 < branch["first flip"] < 151.9


def test_a_drawing_is_written(tmp_path):
    command = ["reproduce", "figure-2.7", "--out", str(tmp_path)]
    found = CliRunner().invoke(app, command)
    assert found.exit_code == 0, found.output
    assert {file.name for file in tmp_path.iterdir()} == {
        "figure-2.7.csv",
        "figure-2.7.json",
        "figure-2.7.png",
    }
