"""Files of other programs: read as they are written, or refused in one sentence."""

import gzip
import io
import sys

import hostile_files
import numpy as np
import pytest
from scipy.io import savemat

from jaxcam.recordings import read_case, read_recording, Recording, RecordingError
from jaxcam.recordings.files import mend, read_recordings


TIME = np.arange(6) * 0.01
ANGLE = np.array([0.5, 0.25, -1.5, 2.0, 0.125, 3.0])
HEIGHT = {"Frame": ("time_s", 0.005), "Y1": ("height_m", -8e-4)}
QTM = """NO_OF_FRAMES\t3
NO_OF_CAMERAS\t8
NO_OF_MARKERS\t2
FREQUENCY\t200
NO_OF_ANALOG\t0
DESCRIPTION\t--
TIME_STAMP\t2026-01-01, 12:00:00\t3.5
DATA_INCLUDED\t3D
MARKER_NAMES\tcart left\tbase
"""
LABVIEW = """LabVIEW Measurement\t
Writer_Version\t2
Separator\tTab
Date\t2026/01/01
***End_of_Header***\t
\t
Channels\t2
Samples\t3\t3
X0\t0.0E+0\t0.0E+0
Delta_X\t0.01\t0.01
***End_of_Header***\t\t
X_Value\tangle\tforce\tComment
0.00\t0.5\t1\t
0.01\t0.6\t2\t
0.02\t0.7\t3\t
"""
IMAGEJ = " \tArea\tX\tY\tSlice\n1\t8\t3.5\t10\t1\n2\t8\t3.6\t12\t2\n3\t9\t3.7\t16\t3\n"
MTRACK = """Frame\tX1\tY1\tFlag1\tX2\tY2\tFlag2
Tracks 1 to 2\t \t
1\t150.1\t10\t \t \t \t
2\t150.2\t12\t \t7\t8\t
3\t150.3\t16\t \t \t \t

Track \tLength\tDistance traveled\tNr of Frames
1\t3.5\t6\t3
"""
TRACKER = "mass A\nt\tx\ty\n0.0\t1.5\t0\n1E-2\t1.4\t0\n2E-2\t1.2\t0\n"


def written(folder, content, name="run.csv"):
    file = folder / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return file


def table(mark=";", comma=False, head="time_s;angle_rad"):
    rows = [f"{t:.2f}{mark}{a:.3f}" for t, a in zip(TIME, ANGLE)]
    rows = [row.replace(".", ",") if comma else row for row in rows]
    return "\n".join([*([head.replace(";", mark)] if head else []), *rows, ""])


def is_the_table(run):
    np.testing.assert_allclose(run.time, TIME, atol=1e-12)
    np.testing.assert_allclose(run["angle_rad"], ANGLE, atol=1e-12)
    return True


@pytest.mark.parametrize("mark", [";", "\t", " ", "  ", " ; "])
@pytest.mark.parametrize("comma", [False, True])
@pytest.mark.parametrize("preamble", ["", "Rig 3\n\n# 5 N, 2 s\n", "a;b;c\n1;x\n"])
def test_separators_and_decimal_commas(tmp_path, mark, comma, preamble):
    (run,) = read_recordings(written(tmp_path, preamble + table(mark, comma)))
    assert is_the_table(run)


@pytest.mark.parametrize(
    "head",
    [
        "Time (s);Angle (rad)",
        "time [s];ANGLE [rad]",
        "Time/ms;Angle/°",
        "# time_s;angle_rad",
        "time;angle\ns;rad",
        "time;angle\n(ms);[deg]",
        '"time_s";"angle_rad"',
    ],
)
def test_a_unit_beside_a_name_or_below_it(tmp_path, head):
    (run,) = read_recordings(written(tmp_path, table(head=head)))
    time, angle = (1e-3, np.pi / 180) if "ms" in head else (1.0, 1.0)
    np.testing.assert_allclose(run.time, TIME * time, atol=1e-12)
    np.testing.assert_allclose(run["angle_rad"], ANGLE * angle, atol=1e-12)


def test_every_unit_that_is_converted_is_known_in_a_heading(tmp_path):
    """MN, a meganewton, is not mistaken for mN."""
    heads = "Time (s);a (mm/s^2);w [°/s²];b/deg/s^2;F (mN);G (MN);p (turns)"
    text = "\n".join([heads, *(f"{k};1;1;1;1;{k};{k}" for k in range(4)), ""])
    (run,) = read_recordings(written(tmp_path, text))
    factors = {
        "a_m_s2": 1e-3,
        "w_rad_s2": np.pi / 180,
        "b_rad_s2": np.pi / 180,
        "f_N": 1e-3,
        "G (MN)": 1,
        "p_rad": 2 * np.pi,
    }
    assert {name: samples[1] for name, samples in run.channels.items()} == factors


@pytest.mark.parametrize("how", ["utf-16", "utf-8-sig", "cp1252"])
def test_encodings_of_other_programs(tmp_path, how):
    text = "Weg µ\n" + table(head="Zeit (s);Winkel (°)")
    (run,) = read_recordings(
        written(tmp_path, text.encode(how)),
        columns={"Zeit (s)": "time_s", "Winkel (°)": "angle_rad"},
    )
    assert is_the_table(run)


def test_a_file_without_a_line_of_names(tmp_path):
    file = written(tmp_path, table(head=""))
    with pytest.raises(RecordingError, match="all 2 columns.*--columns time_s"):
        read_recordings(file)
    (run,) = read_recordings(file, columns=["time_s", "angle_rad"])
    assert is_the_table(run)
    (only,) = read_recordings(file, columns=["-", "angle_deg"], rate=100.0)
    np.testing.assert_allclose(only.time, TIME)
    np.testing.assert_allclose(only["angle_rad"], np.deg2rad(ANGLE))
    with pytest.raises(RecordingError, match="row 1 has 2 values, but --columns"):
        read_recordings(file, columns=["time_s", "angle_rad", "force_N"])
    for names in (["time_s", "time_s"], ["-", "-"], ["time_s", ""]):
        with pytest.raises(RecordingError, match="give each column one name"):
            read_recordings(file, columns=names)


@pytest.mark.parametrize("where", ["rows", "names", "both"])
@pytest.mark.parametrize("mark", [";", ",", "\t"])
def test_a_separator_behind_the_last_column(tmp_path, mark, where):
    head, *rows = table(mark).splitlines()
    head += mark if where != "rows" else ""
    rows = [row + mark if where != "names" else row for row in rows]
    (run,) = read_recordings(written(tmp_path, "\n".join([head, *rows, ""])))
    assert is_the_table(run)


def test_names_of_the_file_become_channels(tmp_path):
    file = written(tmp_path, table(head="t;Angle of the arm"))
    names = {"t": "time_s", "Angle of the arm": ("angle_deg", 180 / np.pi)}
    assert is_the_table(read_recording(file, channels=["angle_rad"], columns=names))
    (tmp_path / "case").mkdir()
    written(tmp_path / "case", table(head="t;Angle of the arm"), "a.csv")
    case = read_case(tmp_path / "case", channels=["angle_rad"], columns=names)
    assert is_the_table(case[0])
    with pytest.raises(RecordingError, match="`angle_rad` is missing.*columns"):
        read_recordings(file, channels=["angle_rad"], columns={"t": "time_s"})
    # the headings of the file, not the channels that they would become
    with pytest.raises(RecordingError, match="file has `t`, `Angle of the arm`;"):
        read_recordings(file, channels=["gyro_rad_s"], columns=names)
    with pytest.raises(RecordingError, match="no column `T`.*is `t` meant"):
        read_recordings(file, columns={"T": "time_s"})
    with pytest.raises(RecordingError, match="factor of `t` is 0"):
        read_recordings(file, columns={"t": ("time_s", 0.0)})


def test_rows_that_lack_a_channel_are_left_out_and_said(tmp_path):
    text = "time_s,a_m,note\n0,,x\n0.1,1,y\n0.2,2,\n0.3,3,z\n0.4,,z\n"
    (run,) = read_recordings(written(tmp_path, text), columns={"a_m": "height_m"})
    np.testing.assert_array_equal(run["height_m"], [1, 2, 3])
    (note,) = run.meta["notes"]
    assert "2 rows, the first of them row 1 (counted without the heading)," in note


def test_a_single_row_without_a_number_is_said_in_the_singular(tmp_path):
    rows = [f"{k / 1000},{k if k != 12 else 'NaN'}" for k in range(60)]
    text = "\n".join(["time_s,a_m", *rows, ""])
    columns = {"a_m": "height_m"}
    (run,) = read_recordings(written(tmp_path, text), columns=columns, gaps="mend")
    notes = " ".join(run.meta["notes"])
    assert "row 13 (counted without the heading) has no number" in notes
    (note,) = mend(Recording("run", np.delete(np.arange(60) / 1e3, 12), {})).notes
    assert "1 sample (1.7 %) is missing" in note


def test_qualisys(tmp_path):
    rows = "1\t2\t3\t4\t5\t6\n2\t3\t4\t0\t0\t0\n3\t4\t5\t4\t5\t7\n"
    names = {"cart_left_z_mm": "height_mm"}
    (run,) = read_recordings(written(tmp_path, QTM + rows, "a.tsv"), columns=names)
    np.testing.assert_allclose(run.time, [0, 0.005, 0.01])
    np.testing.assert_allclose(run["height_m"], [0.003, 0.004, 0.005])
    numbered = "Frame\tTime\tl X\tl Y\tl Z\tb X\tb Y\tb Z\n" + "".join(
        f"{k}\t{k / 200}\t{row}\n" for k, row in enumerate(rows.splitlines())
    )
    timed = written(tmp_path, QTM + numbered, "b.tsv")
    (run,) = read_recordings(timed, columns=names)
    np.testing.assert_allclose(run["height_m"], [0.003, 0.004, 0.005])
    # zeros are how a marker is written that no camera saw
    with pytest.raises(RecordingError, match="`base_x_mm` has nothing"):
        read_recordings(timed)


def test_labview(tmp_path):
    names = {"X_Value": "time_s", "angle": "angle_deg"}
    (run,) = read_recordings(written(tmp_path, LABVIEW, "a.lvm"), columns=names)
    np.testing.assert_allclose(run["angle_rad"], np.deg2rad([0.5, 0.6, 0.7]))
    np.testing.assert_allclose(run.time, [0, 0.01, 0.02])


def test_imagej(tmp_path):
    names = {"Slice": ("time_s", 0.01), "Y": ("height_mm", -0.5)}
    (run,) = read_recordings(written(tmp_path, IMAGEJ, "Results.xls"), columns=names)
    np.testing.assert_allclose(run["height_m"], [-5e-3, -6e-3, -8e-3])


def test_tracks_of_a_video(tmp_path):
    (run,) = read_recordings(written(tmp_path, MTRACK, "a.tsv"), columns=HEIGHT)
    np.testing.assert_allclose(run["height_m"], [-8e-3, -9.6e-3, -1.28e-2])
    assert "begins in line 7" in run.meta["notes"][0]
    spaced = MTRACK.replace("\t", " ")
    with pytest.raises(RecordingError, match="with spaces as separators, empty cells"):
        read_recordings(written(tmp_path, spaced, "b.tsv"), columns=HEIGHT)


def test_tracker(tmp_path):
    names = {"t": "time_s", "x": "position_m"}
    (run,) = read_recordings(written(tmp_path, TRACKER, "a.txt"), columns=names)
    np.testing.assert_allclose(run["position_m"], [1.5, 1.4, 1.2])


def test_text_of_any_kind_where_a_folder_has_nothing_else(tmp_path):
    written(tmp_path, table(), "a.txt")
    assert len(read_case(tmp_path, channels=[])) == 1
    written(tmp_path, table(), "b.csv")
    assert [run.name for run in read_case(tmp_path, channels=[])] == ["b"]


def test_vectors_inside_structures(tmp_path):
    left = {"angle_rad": ANGLE, "force": ANGLE[:, None]}
    data = {
        "run": {"time_s": TIME, "left": left, "right": {"force": 2 * ANGLE}},
        "markers": np.stack([ANGLE, TIME, -ANGLE]),
        "rate": 100.0,
    }
    savemat(tmp_path / "run.mat", data)
    names = {"run.right.force": "force_N", "markers.3": "height_mm"}
    (run,) = read_recordings(
        tmp_path / "run.mat", columns=names, channels=["angle_rad"]
    )
    assert is_the_table(run)
    np.testing.assert_allclose(run["force_N"], 2 * ANGLE)
    np.testing.assert_allclose(run["height_m"], -1e-3 * ANGLE)
    with pytest.raises(RecordingError, match="columns already have names"):
        read_recordings(tmp_path / "run.mat", columns=["time_s"])
    several = np.array([({"x": k * ANGLE},) for k in (1, 2)], dtype=[("log", object)])
    savemat(tmp_path / "several.mat", {"runs": several})
    (run,) = read_recordings(
        tmp_path / "several.mat", columns={"runs.2.log.x": "angle_rad"}, rate=100.0
    )
    np.testing.assert_allclose(run["angle_rad"], 2 * ANGLE)


def workbook(tmp_path, **sheets):
    pytest.importorskip("openpyxl")
    import pandas as pd

    file = tmp_path / "run.xlsx"
    with pd.ExcelWriter(file) as writer:
        for name, rows in sheets.items():
            pd.DataFrame(rows).to_excel(
                writer, sheet_name=name, header=False, index=False
            )
    return file


def test_a_workbook(tmp_path):
    rows = [["Rig", None], ["Time (s)", "angle_rad"], *zip(TIME, ANGLE)]
    (run,) = read_recordings(workbook(tmp_path, one=rows, notes=[["by hand"]]))
    assert is_the_table(run)
    with pytest.raises(RecordingError, match="tables on the sheets `a`, `b`"):
        read_recordings(workbook(tmp_path, a=rows, b=rows))
    with pytest.raises(RecordingError, match="no table"):
        read_recordings(workbook(tmp_path, a=[["by hand"]]))
    rows[3] = [0.01, "lost"]
    with pytest.raises(RecordingError, match="`lost` instead of a number .* row 2"):
        read_recordings(workbook(tmp_path, a=rows))
    with pytest.raises(RecordingError, match="not an Excel workbook"):
        read_recordings(written(tmp_path, b"PK\3\4 broken", "b.xlsx"))


def test_what_is_missing_is_said_with_the_command_that_installs_it(
    tmp_path, monkeypatch
):
    for module in ("openpyxl", "pyarrow"):
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(RecordingError, match=r"pip install 'jaxcam\[excel\]'"):
        read_recordings(written(tmp_path, b"", "a.xlsx"))
    with pytest.raises(RecordingError, match=r"pip install 'jaxcam\[parquet\]'"):
        read_recordings(written(tmp_path, b"", "a.parquet"))


def matlab(**variables) -> bytes:
    stream = io.BytesIO()
    savemat(stream, variables)
    return stream.getvalue()


GOOD = table(",", head="time_s;angle_rad")
#: a file, and what must be said of it
HOSTILE = {
    "empty.csv": ("", "is empty"),
    "blank.csv": ("\n \n\t\n", "is empty"),
    "header.csv": ("time_s,angle_rad\n", "0 rows"),
    "one_row.csv": ("time_s,angle_rad\n0,1\n", "1 rows"),
    "words.csv": ("Lorem ipsum dolor\nsit amet\nconsectetur\n", "row 1"),
    "nan.csv": (GOOD.replace("-1.500", "NaN"), "`NaN` instead of a number"),
    "inf.csv": (GOOD.replace("-1.500", "inf"), "`inf` instead of a number"),
    "hole.csv": (GOOD.replace("-1.500", ""), "nothing instead of a number"),
    "word.csv": (GOOD.replace("-1.500", "off"), "`off` instead of a number"),
    "first_word.csv": (GOOD.replace("0.500", "off"), "in row 1"),
    "first_words.csv": (GOOD.replace("0.00,0.500", "x,y"), "in row 1"),
    "error.csv": (GOOD.replace("-1.500", "#DIV/0!"), "`#DIV/0!`"),
    "hex.csv": (GOOD.replace("-1.500", "0x1F"), "`0x1F`"),
    "date.csv": (GOOD.replace("0.02", "2026-01-01"), "`2026-01-01`"),
    "clock.csv": (GOOD.replace("0.02", "12:30:01"), "`12:30:01`"),
    "percent.csv": (GOOD.replace("-1.500", "15%"), "`15%`"),
    "unit.csv": (GOOD.replace("-1.500", "1.5 rad"), "`1.5 rad`"),
    "huge.csv": (GOOD.replace("-1.500", "1e30"), "no sensor can measure"),
    "overflow.csv": (GOOD.replace("-1.500", "1e999"), "instead of a number"),
    "more.csv": (GOOD.replace("-1.500", "1,5"), "row 3 has 3 values"),
    "less.csv": (GOOD.replace("0.02,-1.500", "0.02"), "row 3 has 1 values"),
    "cut.csv": (GOOD[:-4], "truncated"),
    "cut_more.csv": (GOOD[:-7], "truncated"),
    "cut.csv.gz": (gzip.compress(GOOD.encode())[:-9], "truncated"),
    "damaged.csv.gz": (gzip.compress(GOOD.encode())[:20] + b"x" * 30, "damaged"),
    "plain.csv.gz": (GOOD, "not compressed"),
    "renamed.csv": (gzip.compress(GOOD.encode()), "not a text file"),
    "picture.csv": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "not a text file"),
    "old.xls": (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "a pre-2007 Excel"),
    "book.csv": (b"PK\3\4\x14\0\x06\0\xff\xff", "not a text file"),
    "text.mat": (GOOD, "not a MATLAB file"),
    "new.mat": (b"\x89HDF\r\n\x1a\n", "version 7.3"),
    "empty.mat": (matlab(), "no columns"),
    "scalar.mat": (matlab(time_s=1.0), "no columns"),
    "word.mat": (matlab(time_s="abc"), "no columns"),
    "complex.mat": (matlab(time_s=TIME + 1j), "no columns"),
    "untimed.mat": (matlab(angle_rad=ANGLE), "`time_s` is missing"),
    "nan.mat": (matlab(time_s=TIME, a=ANGLE * np.nan), "in row 1"),
    "other_time.mat": (matlab(time_s=TIME[:3], angle_rad=ANGLE), "`angle_rad` is"),
    "cut.mat": (matlab(time_s=TIME, a_rad=ANGLE)[:150], "not a MATLAB file"),
    "headless.csv": (table(",", head=""), "--columns"),
    "headless.tsv": (table("\t", head=""), "name all 2 columns"),
    "noted.csv": ("Rig 3\n" + table(head=""), "no line does so"),
    "twice.csv": (GOOD.replace("angle_rad", "time_s"), "appears twice"),
    "same_unit.csv": ("time_s,time_ms\n0,0\n1,1000\n", "two columns give `time_s`"),
    "nameless.csv": (GOOD.replace("angle_rad", ""), "column 2 has no name"),
    "no_time.csv": (GOOD.replace("time_s", "t"), "`time_s` is missing"),
    "no_unit.csv": (GOOD.replace("time_s", "Time"), "`time_s` is missing"),
    "strange_unit.csv": (GOOD.replace("time_s", "Time (h)"), "the file has `Time (h)`"),
    "empty_unit.csv": (GOOD.replace("time_s", "time ()"), "`time ()`"),
    "other.csv": (GOOD.replace("angle_rad", "angle"), "`angle_rad` is missing"),
    "other_unit.csv": (GOOD.replace("angle_rad", "angle_m"), "`angle_rad` is"),
    "commas.csv": (table(",", comma=True), "decimal commas"),
    "thousands.csv": (table().replace("2.000", "2.000,0"), "point and a comma"),
    "wider.csv": (GOOD.replace("angle_rad", "angle_rad,f_N"), "header names 3"),
    "narrower.csv": ("time_s,a_rad\n" + "0,1,2\n1,2,3\n", "header names 2"),
    "mixed.csv": (GOOD.replace("0.02,-1.500", "0.02;-1.500"), "row 3 has 1 values"),
    "quote.csv": (GOOD.replace("-1.500", '"-1.5'), "row 3"),
    "backwards.csv": ("time_s,angle_rad\n2,1\n1,2\n0,3\n", "does not increase"),
    "still.csv": ("time_s,angle_rad\n0,1\n0,2\n1,3\n", "does not increase"),
    "nanoseconds.csv": (
        "time_s,angle_rad\n0,1\n1e-10,2\n2e-10,3\n",
        "unit of time",
    ),
    "gap.csv": (GOOD.replace("0.05", "0.50"), "a gap in time"),
    "dead.csv": ("time_s,angle_rad\n0,1\n1,1\n2,1\n", "1 throughout"),
    "summary.csv": (GOOD + "Mean,0.7\n", "`Mean` instead of a number"),
    "header_twice.csv": (GOOD + GOOD, "instead of a number"),
    "markdown.csv": ("|time_s|angle_rad|\n|---|---|\n|0|1|\n|1|2|\n", "row 1"),
    "json.csv": ('{"time_s": [0, 1], "angle_rad": [1, 2]}\n', "0 rows"),
    "html.csv": ("<table><tr><td>time_s</td></tr>\n<tr><td>0</td></tr>\n", "1 rows"),
    "nul.csv": (GOOD.replace("-1.500", "1\0"), "instead of a number"),
    "space_holes.csv": (
        "time_s angle_rad f_N\n0 1 2\n1 2\n2 3 4\n",
        "save it with tabs",
    ),
    "utf32.csv": (GOOD.encode("utf-32"), ""),
    "qtm_cut.tsv": (QTM, ""),
    "qtm_short.tsv": (QTM + "1\t2\t3\n4\t5\t6\n", ""),
    "lvm_cut.lvm": (LABVIEW[:150], ""),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_file_that_cannot_be_used_is_refused_in_one_sentence(tmp_path, name):
    content, wanted = HOSTILE[name]
    file = written(tmp_path, content, name)
    with pytest.raises(RecordingError) as caught:
        read_recordings(file, channels=["angle_rad"])
    hostile_files.said(caught.value)
    assert file.stem in str(caught.value) and caught.value.__cause__ is None
    assert wanted in str(caught.value)


@pytest.mark.parametrize("rate", [0.0, -5.0, float("nan"), float("inf")])
def test_a_rate_that_is_none(tmp_path, rate):
    file = written(tmp_path, GOOD)
    with pytest.raises(RecordingError, match="give a positive number"):
        read_recordings(file, columns=["-", "angle_rad"], rate=rate)
    with pytest.raises(RecordingError, match="already has the time column"):
        read_recordings(file, rate=100.0)
