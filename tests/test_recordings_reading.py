"""Reading recordings: good files as they are, bad files with one sentence."""

import dataclasses
import gzip
import math

import hypothesis
import hypothesis.strategies as st
import numpy as np
import pytest

from jaxcam.data import DEMO_RIG
from jaxcam.recordings import read_case, read_recording, Recording, RecordingError
from jaxcam.recordings.files import CAM_FOLLOWER, Case, check_drive, read_recordings


SPEED = 150.0 * math.pi / 30


def columns(count=200):
    time = np.arange(count) * 5e-4
    follower = 0.25 + 0.05 * np.sin(SPEED * time)
    return {
        "time_s": time,
        "cam_angle_rad": SPEED * time,
        "follower_angle_rad": follower,
    }


def text(table, digits=9):
    rows = (",".join(f"{x:.{digits}f}" for x in row) for row in zip(*table.values()))
    return "\n".join([",".join(table), *rows, ""])


def written(folder, content, name="run1_150.0rpm.csv"):
    file = folder / name
    raw = content.encode() if isinstance(content, str) else content
    file.write_bytes(gzip.compress(raw) if name.endswith(".gz") else raw)
    return file


def refusal(file, **options):
    """The sentence with which a file is refused: one line, one sentence."""
    with pytest.raises(RecordingError) as caught:
        read_recording(file, **options)
    sentence = str(caught.value)
    assert "\n" not in sentence and sentence.endswith(".")
    assert caught.value.__cause__ is None
    return sentence


@pytest.mark.parametrize("name", ["run1_150.0rpm.csv", "run1_150.0rpm.csv.gz"])
def test_reads_plain_and_compressed(tmp_path, name):
    table = columns()
    recording = read_recording(written(tmp_path, text(table), name))
    assert recording.name == "run1_150.0rpm"
    assert recording.nominal_speed == pytest.approx(SPEED)
    np.testing.assert_allclose(recording.time, table["time_s"], atol=1e-9)
    for channel in ("cam_angle_rad", "follower_angle_rad"):
        np.testing.assert_allclose(recording[channel], table[channel], atol=1e-9)
    assert recording.interval == pytest.approx(5e-4)
    assert len(recording.between(0.01, 0.02)) == 20


def test_units_in_column_names_are_converted(tmp_path):
    table = columns()
    other = {
        "time_ms": table["time_s"] * 1e3,
        "cam_angle_turns": table["cam_angle_rad"] / (2 * math.pi),
        "follower_angle_deg": np.degrees(table["follower_angle_rad"]),
        "motor_rpm": 150 + np.sin(table["time_s"]),
        "stretch_mm": 3 + table["time_s"],
    }
    recording = read_recording(written(tmp_path, text(other)))
    for channel in ("cam_angle_rad", "follower_angle_rad"):
        np.testing.assert_allclose(recording[channel], table[channel], atol=1e-7)
    assert recording["motor_rad_s"][0] == pytest.approx(SPEED)
    assert recording["stretch_m"][0] == pytest.approx(3e-3)


@hypothesis.given(
    st.lists(
        st.floats(-1e6, 1e6, allow_nan=False), min_size=2, max_size=30, unique=True
    ),
    st.sampled_from([",", ";", "\t"]),
    st.booleans(),
)
def test_any_numbers_come_back_as_written(tmp_path_factory, numbers, mark, newline):
    rows = [f"{i}{mark}{x!r}" for i, x in enumerate(numbers)]
    content = "\n".join([f"time_s{mark}height_m", *rows]) + ("\n" if newline else "")
    folder = tmp_path_factory.mktemp("numbers")
    # without a last newline a shorter last number may be a cut one
    widths = {len(row.partition(mark)[2].partition(".")[2]) for row in rows[:-1]}
    hypothesis.assume(newline or len(widths) != 1)
    (recording,) = read_recordings(written(folder, content, "drop.csv"))
    np.testing.assert_array_equal(recording["height_m"], numbers)


def test_split_by_a_column(tmp_path):
    content = "drop,time_s,height_m\n1,0,5\n1,0.1,4.9\n2,0,7\n2,0.1,6.9\n2,0.2,6.7\n"
    runs = read_recordings(written(tmp_path, content, "ball.csv"), split="drop")
    assert [(run.name, len(run)) for run in runs] == [
        ("ball_drop1", 2),
        ("ball_drop2", 3),
    ]
    assert "drop" not in runs[0].channels


def test_gaps_are_refused_or_split(tmp_path):
    table = {name: np.delete(v, slice(80, 120)) for name, v in columns().items()}
    file = written(tmp_path, text(table))
    sentence = refusal(file)
    assert "a gap in time at 0.0395 s, 0.0205 s long" in sentence
    assert 'gaps="split"' in sentence
    pieces = read_recordings(file, gaps="split")
    assert [len(piece) for piece in pieces] == [80, 80]
    assert pieces[1].name == "run1_150.0rpm_piece2"


def test_empty_files(tmp_path):
    assert "is empty" in refusal(written(tmp_path, ""))
    assert "is empty" in refusal(written(tmp_path, "", "a.csv.gz"))
    assert "0 rows" in refusal(written(tmp_path, "time_s,cam_angle_rad\n"))


@hypothesis.given(st.integers(1, 60))
@hypothesis.settings(max_examples=20)
def test_truncated_gz(tmp_path_factory, lost):
    raw = gzip.compress(text(columns()).encode())
    file = tmp_path_factory.mktemp("cut") / "run1_150.0rpm.csv.gz"
    file.write_bytes(raw[:-lost])
    assert "truncated" in refusal(file)


@hypothesis.given(st.integers(2, 25))
@hypothesis.settings(max_examples=20)
def test_truncated_last_line(tmp_path_factory, lost):
    content = text(columns(), digits=9)
    file = tmp_path_factory.mktemp("cut") / "run1_150.0rpm.csv"
    file.write_text(content[:-lost])
    assert "the last line" in refusal(file)


def test_rows_of_other_length(tmp_path):
    lines = text(columns()).splitlines()
    lines[7] += ",1.0"
    sentence = refusal(written(tmp_path, "\n".join(lines) + "\n"))
    assert "row 7 has 4 values" in sentence


def test_missing_and_wrong_columns(tmp_path):
    table = columns()
    table["follower"] = table.pop("follower_angle_rad")
    file = written(tmp_path, text(table))
    assert set(read_recording(file).channels) == {"cam_angle_rad", "follower"}
    sentence = refusal(file, channels=CAM_FOLLOWER)
    assert "`follower_angle_rad` is missing" in sentence
    assert "`time_s`, `cam_angle_rad`, `follower`" in sentence
    headless = "\n".join(text(columns()).splitlines()[1:]) + "\n"
    assert "must name the columns" in refusal(written(tmp_path, headless))
    twice = text(columns()).replace("follower_angle_rad", "cam_angle_rad")
    assert "appears twice" in refusal(written(tmp_path, twice))
    both = {**columns(), "cam_angle_deg": columns()["cam_angle_rad"]}
    assert "two columns give `cam_angle_rad`" in refusal(written(tmp_path, text(both)))
    recording = read_recording(written(tmp_path, text(columns())))
    with pytest.raises(RecordingError, match="no channel `gyro_rad_s`"):
        recording["gyro_rad_s"]


@pytest.mark.parametrize("word", ["nan", "inf", "", "abc", "--"])
def test_what_is_not_a_number(tmp_path, word):
    lines = text(columns()).splitlines()
    lines[10] = ",".join([*lines[10].split(",")[:2], word])
    sentence = refusal(written(tmp_path, "\n".join(lines) + "\n"))
    assert "row 10" in sentence and (word or "nothing") in sentence


def test_time_must_increase(tmp_path):
    table = columns()
    table["time_s"][50] = table["time_s"][48]
    assert "from row 50 " in refusal(written(tmp_path, text(table)))
    table = columns()
    table["time_s"][50] = table["time_s"][49]
    assert "time does not increase" in refusal(written(tmp_path, text(table)))


def test_rounded_times_are_said_to_be_rounded(tmp_path):
    """Times in hundredths of a second at 150 samples per second."""
    table = columns()
    number = len(table["time_s"])
    table["time_s"] = np.round(np.arange(number) / 150.0, 2)
    sentence = refusal(written(tmp_path, text(table)))
    assert "seem to be rounded" in sentence and "--rate 149.6" in sentence
    table["time_s"] = np.full(number, 3.0)
    assert "all times are 3 s" in refusal(written(tmp_path, text(table)))
    # a single row that is doubled
    table["time_s"] = np.arange(number) / 50.0
    table["time_s"][20] = table["time_s"][19]
    assert "keep one of those" in refusal(written(tmp_path, text(table)))


def test_other_units_than_the_name_says(tmp_path):
    table = columns()
    degrees = {**table, "follower_angle_rad": np.degrees(table["follower_angle_rad"])}
    sentence = refusal(written(tmp_path, text(degrees)))
    assert "looks like degrees" in sentence and "follower_angle_deg" in sentence
    degrees = {**table, "cam_angle_rad": np.degrees(table["cam_angle_rad"])}
    sentence = refusal(written(tmp_path, text(degrees)))
    assert "looks like degrees" in sentence and "cam_angle_deg" in sentence
    turns = {**table, "cam_angle_rad": table["cam_angle_rad"] / (2 * np.pi)}
    assert "looks like turns" in refusal(written(tmp_path, text(turns)))
    milliseconds = {**table, "time_s": table["time_s"] * 1e3}
    assert "milliseconds" in refusal(written(tmp_path, text(milliseconds)))
    file = written(tmp_path, text(table), "run1_170.0rpm.csv")
    assert "150.0 rpm, but the file name gives 170.0 rpm" in refusal(file)


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("wraps", [False, True])
@pytest.mark.parametrize(("unit", "turn"), [("degrees", 360.0), ("turns", 1.0)])
def test_an_angle_in_another_unit_that_jumps_at_each_revolution(
    rate, wraps, unit, turn
):
    """10 rad/s; at 100 Hz a step of 5.7 degrees is more than half a turn in rad."""
    turned = 10.0 / (2 * np.pi) * np.arange(0.0, 2.0, 1 / rate)
    angle = turn * (turned % 1 if wraps else turned)
    run = Recording("run", np.arange(len(angle)) / rate, {"cam_angle_rad": angle}, 10.0)
    with pytest.raises(RecordingError, match=f"`cam_angle_rad` looks like {unit}"):
        check_drive(run)


def test_dead_channel(tmp_path):
    table = {**columns(), "gyro_rad_s": np.full(200, 0.5)}
    assert "`gyro_rad_s` is 0.5 throughout" in refusal(written(tmp_path, text(table)))


def test_wrong_files(tmp_path):
    assert "no such file" in refusal(tmp_path / "none.csv")
    assert "this is a folder" in refusal(tmp_path)
    assert "not compressed" in refusal(written_raw(tmp_path, b"time_s\n", "a.csv.gz"))
    assert "not a text file" in refusal(written_raw(tmp_path, b"\xff\xfe\x81", "b.csv"))


def written_raw(folder, raw, name):
    file = folder / name
    file.write_bytes(raw)
    return file


def test_cases(tmp_path):
    case = read_case(DEMO_RIG)
    assert [run.name[:4] for run in case] == ["run1", "run2", "run3"]
    assert case["run2"] is case[1]
    assert all(len(run) == 8000 for run in case)
    with pytest.raises(RecordingError, match="3 names begin with"):
        case["run"]
    # a whole name counts, even if another name begins with it
    names = ("run1", "run10", "run2")
    many = Case("many", tuple(dataclasses.replace(case[0], name=n) for n in names))
    assert [many[name].name for name in names] == list(names)
    with pytest.raises(RecordingError, match="no such folder"):
        read_case(tmp_path / "none")
    with pytest.raises(RecordingError, match="this is a file"):
        read_case(written(tmp_path, text(columns())))
    (tmp_path / "cases" / "case1").mkdir(parents=True)
    with pytest.raises(RecordingError, match=r"give one of its folders \(case1\)"):
        read_case(tmp_path / "cases")
