"""`jaxcam reproduce`, as a reader types it."""

import json

import pandas as pd
import pytest
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.thesis import TARGETS


@pytest.fixture(autouse=True)
def keep_the_cache_of_the_tests(monkeypatch):
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", "as the tests have it")


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
    names = ["quantity", "printed", "computed", "unit", "difference"]
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
        (["table-9.9"], "table-5.2"),
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
