"""The lines in which `jaxcam fit` and `jaxcam diagnose` say what they have read."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxcam.cli._found_impacts import found_impacts
from jaxcam.cli._read_summary import channels_of, read_summary
from jaxcam.data import DEMO_RIG
from jaxcam.models import TwoSidedStop
from jaxcam.recordings import read_case, read_recording, read_rig, Recording


def test_what_was_read_is_said_in_two_lines(tmp_path):
    file = tmp_path / "run1.csv"
    rows = (f"{k / 200},{-5 + k},{k * k},7" for k in range(11))
    file.write_text("\n".join(["Zeit,Abstand [mm],gyro_rad_s,count", *rows]) + "\n")
    columns = {
        "Zeit": "time_s",
        "Abstand [mm]": "height_mm",
        "gyro_rad_s": "gyro_rad_s",
    }
    run = read_recording(file, columns=columns)
    first, second = read_summary([run], ["height_m"])
    assert first == (
        "Read 1 recording (run1.csv): 11 samples at 200 Hz, 0.05 s, from 0.0000 s to "
        "0.0500 s."
    )
    # a channel that the model does not describe, and a column that was not read
    assert second.startswith("Channels: height_m from -0.005 to 0.005 m. Columns")
    assert second.endswith("not used: gyro_rad_s, count.")


def test_many_files_and_different_rates_are_said_briefly():
    runs = [
        Recording(f"run{k}", np.arange(5) / k, {"x_m": np.full(5, float(k))}, meta={})
        for k in (1, 2, 4, 8)
    ]
    first, second = read_summary(runs, ["x_m"])
    assert first.startswith("Read 4 recordings (4 files: run1, ..., run8): 20 samples")
    assert "at 1 to 8 Hz, 0.5 to 4 s each" in first
    assert second == "Channels: x_m from 1 to 8 m."


def test_the_drive_of_a_cam_is_used():
    used = channels_of(read_rig(DEMO_RIG / "rig.toml"))
    _, second = read_summary(tuple(read_case(DEMO_RIG)), used)
    assert "cam_angle_rad" in second and "not used" not in second


def _segments(name, sides, contacts=0):
    """What a sentence about impacts needs to know about a recording."""
    found = SimpleNamespace(count=len(sides), side=np.array(sides, dtype=int))
    return SimpleNamespace(
        recording=SimpleNamespace(name=name), impacts=found, contacts=(0,) * contacts
    )


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        ([([], 0)], ""),
        ([([0], 0)], "1 impact (1 with upper stop and 0 with lower stop)."),
        (
            [([0, 1, 1], 1), ([], 0)],
            "3 impacts (1 with upper stop and 2 with lower stop) and 1 longer "
            "contact, but nothing in run1.",
        ),
        (
            [([], 2), ([], 0), ([], 0)],
            "2 longer contacts, but nothing in run1 and run2.",
        ),
    ],
)
@pytest.mark.usefixtures("unchecked_types")
def test_impacts_that_were_found_are_counted(parts, sentence):
    """By stop, with the recordings in which nothing was found."""
    system = TwoSidedStop()
    runs = [_segments(f"run{k}", *part) for k, part in enumerate(parts)]
    expected = sentence and f"Found in the recordings: {sentence}"
    assert found_impacts(runs, system) == expected
