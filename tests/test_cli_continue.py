"""`jaxcam continue`, as a reader types it."""

import io
import json
import re
import shlex
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console
from typer.main import get_command
from typer.testing import CliRunner

import continuation
from jaxcam.cli import app
from jaxcam.cli._axis import Axis
from jaxcam.cli._continue import _columns
from jaxcam.cli._output import Output
from jaxcam.cli._source import Source
from jaxcam.data import NEW_RIG


def jaxcam(*arguments):
    return CliRunner().invoke(app, ["continue", *[str(a) for a in arguments]])


def test_examples_in_the_help_name_options_that_exist():
    # an example may go on in the next line
    text = re.sub(r"\\\s*\n\s*", "", jaxcam("--help").stdout)
    found = re.findall(r"^\s+(jaxcam continue.*?)\s*$", text, re.M)
    command = get_command(app).commands["continue"]  # pyright: ignore
    assert len(found) >= 3
    for line in found:
        arguments = shlex.split(line)[2:]
        assert command.make_context("continue", arguments).params


def test_branch_of_the_oscillator(tmp_path):
    """From the orbit without impacts up to its grazing at |gamma|, and behind it."""
    line = "impact-oscillator --parameter wall --at 0.2 --from 0.12 --to 0.3 --state"
    state = "-0.1462,0"
    arguments = [*line.split(), state, "--set", "damping=0.05", "--direction", "down"]
    file, folder = tmp_path / "branch.json", tmp_path / "out"
    found = jaxcam(*arguments, "--json", file, "--out", folder)
    assert found.exit_code == 0, found.output
    data = json.loads(file.read_text())
    w, zeta = 2.8, 0.05
    amplitude = 1 / np.hypot(1 - w * w, 2 * zeta * w)
    first = data["special"][0]
    assert first["kind"] == "grazing" and first["converged"]
    assert first["parameter"] == pytest.approx(amplitude, abs=1e-9)
    assert data["points"][0]["stable"] and data["points"][0]["parameter"] == 0.2
    words = " ".join(found.stdout.split())
    assert "grazing" in words and f"(end): {data['ended']}" in words
    assert {f.name for f in folder.iterdir()} >= {"branch.png", "branch.jsonl"}
    # nothing is left to do, and nothing is done again
    again = jaxcam(*arguments, "--json", file, "--out", folder, "--resume")
    assert again.exit_code == 0, again.output
    assert json.loads(file.read_text())["points"] == data["points"]
    # what an interrupted run left is not replaced
    lines = (folder / "branch.jsonl").read_text().splitlines(keepends=True)
    (folder / "branch.jsonl").write_text("".join(lines[:-1]))
    refused = jaxcam(*arguments, "--out", folder)
    assert refused.exit_code == 2 and "add --resume" in refused.output
    assert len((folder / "branch.jsonl").read_text().splitlines()) == len(lines) - 1


def test_the_largest_multiplier_has_its_sign():
    """That of largest modulus, complex if it is one of a pair, none if unknown."""
    largest = _columns(("x",))["largest multiplier"]

    def shown(*multipliers):
        return largest(SimpleNamespace(multipliers=np.array(multipliers, complex)))

    assert shown(-1.25, 0.5) == -1.25
    assert shown(-0.5 + 0.25j, -0.5 - 0.25j) == -0.5 + 0.25j
    assert shown(-np.inf, 0.5) == -np.inf
    assert shown(np.nan, np.nan) is None and shown() is None


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("pendulum --from 1 --to 2", "cam-follower, impact-oscillator"),
        ("impact-oscillator --parameter wall", "--from A --to B"),
        ("impact-oscillator --parameter wall --from 1 --to 0", "higher value first"),
        ("impact-oscillator --parameter wall --from nan --to 0", "finite"),
        ("impact-oscillator --parameter size --from 0 --to 1", "omega"),
        ("impact-oscillator --parameter wall --from 1 --to 2", "--at"),
        ("impact-oscillator --parameter wall --from 0 --to 1 --state low", "commas"),
        ("impact-oscillator --parameter wall --from 0 --to 1 --periods 0", "1 or more"),
        ("impact-oscillator --parameter wall --from 0 --to 1 --max-points 1", "2 or"),
        ("impact-oscillator --parameter wall --from 0 --to 1 --direction on", "up, "),
        ("impact-oscillator --parameter wall --from 0 --to 1 --algorithm x", "natural"),
        ("impact-oscillator --parameter wall --from 0 --to 1 --resume", "--out DIR"),
        ("--from 130 --to 150 --preset table-9", "table-4.4"),
        ("--from 150 --to 160 --at 145", "outside"),
    ],
)
def test_bad_input_is_one_sentence(line, words):
    found = jaxcam(*line.split())
    assert found.exit_code == 2, found.output
    assert found.stdout == "" and words in found.stderr
    (sentence,) = found.stderr.splitlines()
    assert sentence.endswith(".")


def test_a_table_wider_than_the_terminal_is_not_cut():
    """At 30 columns, every number of a branch is complete."""
    problem = continuation.Equilibrium(lambda u, p: p["a"] - u**2, {"a": 1.0})
    branch = continuation.branch(problem, [1.0], "a", (-1, 2), direction=-1)
    output = Output(None, None)
    output.console = Console(width=30, file=io.StringIO(), record=True)
    columns = {"a long heading": lambda point: point.parameter / 3}
    output.print(continuation.table(branch, columns=columns))
    text = output.console.export_text()
    for point in branch.special:
        assert f"{point.parameter:.9g}" in text and f"{point.parameter / 3:.6g}" in text
    assert continuation.table(branch, columns={}).columns[0].header == "label"


def test_axes_have_the_units_of_the_rig_file():
    units = Source(None, NEW_RIG / "cart.toml").units()
    assert units["stiffness"] == "1/s^2"
    assert Axis.of("stiffness", "Cart", units).label == ("stiffness", "1/s^2")
    # the unit of a parameter without one is unknown
    assert Axis.of("restitution", "Cart", units).label == ("restitution", "")
    assert Axis.of("speed", "cam-follower", units).label == ("speed", "rpm")
