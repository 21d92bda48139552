"""What a rig file says of the files of its recordings."""

import dataclasses
import shutil

import hostile_files
import numpy as np
import pytest
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.data import DEMO_RIG
from jaxcam.fitting import read_setup
from jaxcam.models import BouncingBall
from jaxcam.recordings import read_rig, RecordingError, RigError


# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")

CHANNEL = '[channels.height_m]\nsees = "height"\nnoise = 1e-4\n'
RIG = f"""
rate = 200

[columns]
Y1 = {{channel = "height_mm", factor = -0.8}}

[records."drop1*"]
gravity = 9.83

[records.drop2]
gravity = 1.62

{CHANNEL}"""


def setup_of(tmp_path, text=RIG):
    file = tmp_path / "ball.toml"
    file.write_text(text)
    return read_setup(file, BouncingBall)


def case_of(tmp_path, *names):
    folder = tmp_path / "case"
    folder.mkdir()
    rows = "".join(f"{150 + k}\t{10 + k * k}\t \n" for k in range(20))
    for name in names:
        (folder / f"{name}.tsv").write_text(f"X1\tY1\tFlag1\n{rows}")
    return folder


def test_columns_rate_and_constants_reach_the_recordings(tmp_path):
    setup = setup_of(tmp_path)
    folder = case_of(tmp_path, "drop1", "drop2", "drop3")
    case = setup.read_case(folder)
    for run, gravity in zip(case, (9.83, 1.62, None)):
        np.testing.assert_allclose(run.time, np.arange(20) / 200)
        np.testing.assert_allclose(run["height_m"], -8e-4 * (10 + run.time**2 * 4e4))
        assert run.constants.get("gravity") == gravity
    # a piece of a record is known as the whole is
    piece = dataclasses.replace(case[1], name="drop2_piece2", constants={})
    known = setup.known_of(dataclasses.replace(case, recordings=(piece, *case)))
    assert known[0].constants == {"gravity": 1.62}


def test_constants_of_a_record_that_is_not_there(tmp_path):
    folder = case_of(tmp_path, "drop1")
    with pytest.raises(
        RecordingError, match="drop2.* matches none .*`drop1`"
    ) as caught:
        setup_of(tmp_path).read_case(folder)
    hostile_files.said(caught.value)


def test_constants_of_other_records_are_noted_if_one_was_picked(tmp_path):
    setup = setup_of(tmp_path)
    case = setup.read_case(case_of(tmp_path, "drop1", "drop2"))
    one = dataclasses.replace(case, recordings=case.recordings[:1])
    found = setup.known_of(one, picked=True)
    assert found[0].constants == {"gravity": 9.83}
    (note,) = found[0].meta["notes"]
    assert 'records."drop2"' in note and "not used" in note


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("rate = 200", "rate = 0", "`rate` is 0; give a positive"),
        ("rate = 200", 'rate = "fast"', "give a positive number"),
        ("-0.8", "0", "`factor` in [columns.Y1] is zero"),
        ("factor", "scale", "unknown key `scale`"),
        ('channel = "height_mm", ', "", "has no `channel`"),
        ('"height_mm"', "3", "must be a word"),
    ],
)
def test_what_it_says_wrongly(tmp_path, old, new, said):
    assert old in RIG
    with pytest.raises(RigError) as caught:
        setup_of(tmp_path, RIG.replace(old, new))
    assert said in str(caught.value)
    hostile_files.said(caught.value)


def test_a_rig_of_a_cam_follower_names_columns_too(tmp_path):
    """A recording is refused for the angle in it, and not for the name of that."""
    folder = tmp_path / "case"
    shutil.copytree(DEMO_RIG, folder)
    rig = folder / "rig.toml"
    rig.write_text('[columns]\nlever = "follower_angle_rad"\n' + rig.read_text())
    assert read_rig(rig).cam_radius.value > 0
    for file in folder.glob("*.csv*"):
        file.unlink()
    time = np.arange(400) * 1e-3
    rows = "".join(f"{t:.3f},{15.7 * t:.5f},200\n" for t in time)
    (folder / "run1.csv").write_text(f"time_s,cam_angle_rad,lever\n{rows}")
    found = CliRunner().invoke(app, ["fit", str(folder)])
    assert found.exit_code == 2 and "`follower_angle_rad` is 200" in found.stderr
