"""Recordings from which nothing can be told are refused in one sentence."""

import dataclasses

import numpy as np
import pytest
from fitting_rigs import NOMINAL
from typer.testing import CliRunner

from jaxcam.cli._app import app
from jaxcam.data import DEMO_RIG
from jaxcam.discrepancy import diagnose
from jaxcam.recordings import read_case, RecordingError


@pytest.fixture(scope="module")
def runs():
    return tuple(read_case(DEMO_RIG))


def _changed(runs, change):
    first = runs[0]
    samples = change(first["follower_angle_rad"])
    channels = {**first.channels, "follower_angle_rad": samples}
    return (dataclasses.replace(first, channels=channels), *runs[1:])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x: -x, "wrong sign"),
        (np.rad2deg, "degrees"),
        (lambda x: 0.0 * x + 0.3, "throughout"),
        (lambda x: x + 0.9, "belong to this recording"),
    ],
)
def test_a_wrong_channel_is_named(runs, change, words):
    with pytest.raises(RecordingError, match=words):
        diagnose(NOMINAL, _changed(runs, change))


def test_one_record_is_not_enough(runs):
    with pytest.raises(RecordingError, match="at least two"):
        diagnose(NOMINAL, runs[:1])


def test_a_missing_channel_is_named(runs):
    first = runs[0]
    channels = {"cam_angle_rad": first["cam_angle_rad"]}
    bad = dataclasses.replace(first, channels=channels)
    with pytest.raises(RecordingError, match="follower_angle_rad"):
        diagnose(NOMINAL, (bad, *runs[1:]))


def test_the_command_says_it_in_one_line(tmp_path):
    ending = CliRunner().invoke(app, ["diagnose", str(tmp_path)])
    assert ending.exit_code == 2
    assert "no recording" in ending.output
    assert "Traceback" not in ending.output


def test_a_search_needs_time():
    ending = CliRunner().invoke(app, ["diagnose", "demo", "--minutes", "0"])
    assert ending.exit_code == 2
    assert "`minutes` is 0" in ending.output
