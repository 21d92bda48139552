"""`jaxcam reproduce`, as a reader types it."""

import dataclasses
import json

import pandas as pd
import pytest
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.cli._source_mark import source_hash, source_mark
from jaxcam.thesis import TARGETS
from jaxcam.thesis.target import Target


def jaxcam(*arguments):
    return CliRunner().invoke(app, ["reproduce", *map(str, arguments)])


def test_list_names_every_target():
    found = jaxcam("--list")
    assert found.exit_code == 0, found.output
    assert [line.split(":")[0] for line in found.stdout.splitlines()] == list(TARGETS)


def test_a_table_on_the_terminal_and_in_files(tmp_path):
    file, folder = tmp_path / "found.json", tmp_path / "out"
    found = jaxcam("table-4.4", "--json", file, "--out", folder)
    assert found.exit_code == 0, found.output
    assert "cam radius R" in found.stdout and "0.045" in found.stdout
    (rows,) = json.loads(file.read_text())["tables"].values()
    names = ["quantity", "printed", "computed", "unit", "difference", "relative"]
    assert list(rows[0]) == names
    # the calibrated rig is another one than Table 4.4, by a few per cent
    shifts = {row["quantity"]: row["difference"] for row in rows}
    assert shifts["moment of inertia J"] == 0
    assert 0.1 < abs(shifts["spring coefficient K"]) < 10
    table = pd.read_csv(folder / "table-4.4.csv")
    assert list(table.columns) == names and len(table) == len(rows)


def test_preset_and_json_alone():
    found = jaxcam("table-4.4", "--preset", "table-4.4", "--json", "-")
    written = json.loads(found.stdout)
    assert written["preset"] == "table-4.4"
    assert {row["difference"] for row in written["tables"]["table-4.4"]} == {0.0}


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["table-5.9"], "table-5.2"),
        (["table-4.4", "--preset", "best"], "calibrated"),
        (["table-4.4", "--out", "/dev/null"], "/dev/null"),
    ],
)
def test_wrong_input_ends_with_a_sentence(arguments, word):
    found = jaxcam(*arguments)
    assert found.exit_code == 2
    assert found.stdout == ""
    (line,) = found.stderr.splitlines()
    assert word in line and line.endswith(".")


@pytest.fixture
def few(monkeypatch):
    """Three targets in place of all, one of which fails; what was computed."""
    computed = []

    def counted(name):
        compute = TARGETS[name].compute

        def wrapped(system):
            computed.append(name)
            return compute(system)

        return dataclasses.replace(TARGETS[name], compute=wrapped)

    def fails(system):
        computed.append("figure-5.99")
        raise RuntimeError("no such orbit")

    kept = {name: counted(name) for name in ("figure-2.7", "table-4.4")}
    for name in list(TARGETS):
        monkeypatch.delitem(TARGETS, name)
    monkeypatch.setitem(TARGETS, "figure-2.7", kept["figure-2.7"])
    monkeypatch.setitem(TARGETS, "figure-5.99", Target("Nothing <at all>", fails))
    monkeypatch.setitem(TARGETS, "table-4.4", kept["table-4.4"])
    return computed


def test_one_page_holds_everything_and_one_failure_stops_nothing(few, tmp_path):
    found = jaxcam("all", "--out", tmp_path, "--json", tmp_path / "found.json")
    assert found.exit_code == 1
    assert "figure-5.99 failed: RuntimeError: no such orbit" in found.stderr
    assert few == ["figure-2.7", "figure-5.99", "table-4.4"]
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "cam radius R" in page and "Nothing &lt;at all&gt;" in page
    assert "Failed: RuntimeError: no such orbit" in page
    assert page.count("data:image/png;base64,") == 1
    # nothing is loaded from elsewhere; dark screens and telephones are thought of
    assert "http" not in page.replace("http-equiv", "") and "src=" in page
    assert "prefers-color-scheme: dark" in page and "width=device-width" in page
    written = json.loads((tmp_path / "found.json").read_text())
    assert set(written["tables"]) == {"figure-2.7", "table-4.4"}
    assert list(written["failed"]) == ["figure-5.99"]


def test_resume_computes_what_is_missing_or_had_other_settings(few, tmp_path):
    jaxcam("--out", tmp_path)
    first = (tmp_path / "index.html").read_text(encoding="utf-8")
    few.clear()
    found = jaxcam("--out", tmp_path, "--resume")
    # the one that failed is tried again
    assert few == ["figure-5.99"] and "cam radius R" in found.stdout
    assert (tmp_path / "index.html").read_text(encoding="utf-8").count("<tr>") == (
        first.count("<tr>")
    )
    few.clear()
    (tmp_path / "figure-2.7.png").unlink()
    (tmp_path / "table-4.4.json").write_text("{ half of a file")
    jaxcam("--out", tmp_path, "--resume")
    assert few == ["figure-2.7", "figure-5.99", "table-4.4"]
    few.clear()
    jaxcam("--out", tmp_path, "--resume", "--preset", "table-4.4")
    assert few == ["figure-2.7", "figure-5.99", "table-4.4"]


def test_resume_computes_again_what_other_code_computed(few, tmp_path, monkeypatch):
    """All targets once the mark of the code is another one, and a sentence says so."""
    from jaxcam.cli import _reproduce_record

    jaxcam("--out", tmp_path)
    few.clear()
    monkeypatch.setattr(_reproduce_record, "source_mark", lambda: "another")
    found = jaxcam("--out", tmp_path, "--resume")
    assert few == ["figure-2.7", "figure-5.99", "table-4.4"]
    assert "code has changed since 3 of 3 targets" in " ".join(found.stdout.split())
    # and not a second time
    few.clear()
    found = jaxcam("--out", tmp_path, "--resume")
    assert few == ["figure-5.99"] and "has changed" not in found.stdout


def test_mark_of_the_code_sees_every_change(tmp_path):
    """Contents, names and versions count; what Python does not read does not."""
    (tmp_path / "room").mkdir()
    (tmp_path / "room" / "_a.py").write_text("x = 1\n")
    first = source_hash([tmp_path], ["jax 1"])
    (tmp_path / "room" / "_a.cpython-312.pyc").write_bytes(b"compiled")
    assert source_hash([tmp_path], ["jax 1"]) == first
    assert source_hash([tmp_path], ["jax 2"]) != first
    (tmp_path / "room" / "_a.py").write_text("x = 2\n")
    second = source_hash([tmp_path], ["jax 1"])
    (tmp_path / "room" / "_a.py").rename(tmp_path / "room" / "_b.py")
    third = source_hash([tmp_path], ["jax 1"])
    assert len({first, second, third}) == 3
    assert source_mark() == source_mark() != first


def test_a_run_that_is_stopped_keeps_what_was_done(few, tmp_path, monkeypatch):
    def stopped(system):
        raise KeyboardInterrupt

    monkeypatch.setitem(TARGETS, "figure-5.99", Target("Stopped", stopped))
    found = jaxcam("--out", tmp_path)
    assert found.exit_code == 130
    assert (tmp_path / "figure-2.7.json").is_file()
    assert "1 of 3 targets" in (tmp_path / "index.html").read_text(encoding="utf-8")
    monkeypatch.delitem(TARGETS, "figure-5.99")
    few.clear()
    assert jaxcam("--out", tmp_path, "--resume").exit_code == 0
    assert few == ["table-4.4"]


def test_resume_needs_a_folder():
    found = jaxcam("--resume")
    assert found.exit_code == 2 and "--out" in found.stderr
