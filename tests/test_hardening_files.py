"""Readers of files: whatever they are given, a result or one sentence."""

import gzip
import os

import hostile_files as hostile
import pytest
from hypothesis import given, HealthCheck, settings, strategies as st

from jaxcam.recordings import RecordingError
from jaxcam.recordings.files import read_recordings


# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")

FEW = settings(max_examples=60, suppress_health_check=list(HealthCheck))
GAPS = st.sampled_from(["refuse", "split", "mend"])


@FEW
@given(file=hostile.tables(), gaps=GAPS)
def test_any_table(tmp_path_factory, file, gaps):
    hostile.read_table_or_say(tmp_path_factory.getbasetemp(), *file, gaps)


@FEW
@given(file=hostile.matlab_files(), gaps=GAPS)
def test_any_matlab_file(tmp_path_factory, file, gaps):
    hostile.read_table_or_say(tmp_path_factory.getbasetemp(), *file, gaps)


@FEW
@given(raw=hostile.rigs())
def test_any_rig(tmp_path_factory, raw):
    hostile.read_rig_or_say(tmp_path_factory.getbasetemp(), raw)


@FEW
@given(raw=hostile.systems())
def test_any_saved_system(tmp_path_factory, raw):
    hostile.load_system_or_say(tmp_path_factory.getbasetemp(), raw)


def refusal(file) -> str:
    with pytest.raises(RecordingError) as caught:
        read_recordings(file)
    hostile.said(caught.value)
    return str(caught.value)


def test_a_small_file_that_inflates_to_a_large_one(tmp_path):
    file = tmp_path / "bomb.csv.gz"
    with gzip.open(file, "wb") as stream:
        for _ in range(300):
            stream.write(bytes(1 << 20))
    assert file.stat().st_size < 1_000_000
    assert "more than 100 MB" in refusal(file)


def test_a_gigabyte(tmp_path):
    """Refused by its size; the file has holes, and takes no room."""
    file = tmp_path / "large.csv"
    with file.open("wb") as stream:
        stream.write(b"time_s,x_m\n")
        stream.truncate(1 << 30)
    assert "more than 100 MB" in refusal(file)


def test_a_pipe_that_never_ends(tmp_path):
    os.mkfifo(tmp_path / "run.csv")
    assert "pipe or a device" in refusal(tmp_path / "run.csv")


def test_numbers_that_no_sensor_measures(tmp_path):
    file = tmp_path / "run.csv"
    file.write_text("time_s,x_m\n0,1\n1e300,2\n2e300,3\n")
    assert "no sensor can measure" in refusal(file)
    file.write_text("time_s,x_m\n0,1\n1e-300,2\n2e-300,3\n")
    assert "unit of time" in refusal(file)
