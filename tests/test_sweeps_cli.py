"""`jaxcam diagram` and `jaxcam basins`, as a reader types them."""

import json
import re
import shlex

import numpy as np
import pytest
from typer.main import get_command
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.sweeps import load_sweep


def jaxcam(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.mark.parametrize("name", ["diagram", "basins"])
def test_examples_in_the_help_name_options_that_exist(name):
    help_text = jaxcam(name, "--help").stdout
    found = re.findall(rf"^\s+(jaxcam {name}.*?)\s*$", help_text, re.M)
    command = get_command(app).commands[name]  # pyright: ignore
    assert len(found) >= 3
    for line in found:
        arguments = shlex.split(line)[2:]
        assert command.make_context(name, arguments).params


def test_a_diagram_of_the_oscillator(tmp_path):
    line = "diagram impact-oscillator --parameter omega --from 2.6 --to 2.64 --points 3"
    more = "--turns 60 --keep 12 --state=-0.66,0.02 --direction up"
    arguments = [*line.split(), *more.split()]
    file, folder = tmp_path / "found.json", tmp_path / "out"
    found = jaxcam(*arguments, "--json", file, "--out", folder)
    assert found.exit_code == 0, found.output
    data = json.loads(file.read_text())
    assert data["labels"] == [["P(1,1)"]] * 3
    assert data["ranges"] == [
        {"label": "P(1,1)", "low": 2.6, "high": 2.64, "direction": 1}
    ]
    assert "P(1,1)" in found.stdout
    assert (folder / "diagram.png").stat().st_size > 5000
    assert np.array_equal(load_sweep(folder / "diagram.zarr").values, data["values"])
    refused = jaxcam(*arguments, "--out", folder)
    assert refused.exit_code == 2 and "--resume" in refused.stderr
    again = jaxcam(*arguments, "--json", file, "--out", folder, "--resume")
    assert again.exit_code == 0, again.output
    assert json.loads(file.read_text())["labels"] == data["labels"]


def test_basins_of_the_oscillator(tmp_path):
    line = "basins impact-oscillator --set omega=2.6 --shape 6,8 --turns 64"
    folder = tmp_path / "out"
    found = jaxcam(*line.split(), "--json", "-", "--out", folder)
    assert found.exit_code == 0, found.output
    data = json.loads(found.stdout)
    shares = {row["name"]: row["share"] for row in data["attractors"]}
    assert "P(1,1)" in shares and sum(shares.values()) == pytest.approx(1)
    assert np.shape(data["attractor"]) == (6, 8)
    assert data["entropy"]["entropy"] > 0
    assert (folder / "basins.png").stat().st_size > 5000
    again = jaxcam(*line.split(), "--json", "-", "--out", folder, "--resume")
    assert json.loads(again.stdout)["attractor"] == data["attractor"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("diagram pendulum --from 1 --to 2", "cam-follower, impact-oscillator"),
        ("diagram --from 130", "--from A --to B"),
        ("diagram --from 150 --to 130", "higher value first"),
        ("diagram --from 130 --to 150 --points 0", "--points is 0"),
        ("diagram --from 130 --to 150 --turns 10", "--turns is 10"),
        ("diagram --from 130 --to 150 --direction on", "each, up"),
        ("diagram --from 130 --to 150 --section moon", "stroboscope, impacts"),
        ("diagram --from 130 --to 150 --starts 5", "--low A,B --high A,B"),
        ("diagram --from 130 --to 150 --state a,b", "such as 0.4,1.8"),
        ("diagram --from 130 --to 150 --resume", "--out DIR"),
        ("diagram --from 130 --to 150 --cluster here", "tcp://"),
        ("diagram --from 130 --to 150 --preset table-9", "table-4.4"),
        ("diagram --parameter size --from 1 --to 2", "profile.radius"),
        ("diagram bouncing-ball --from 1 --to 2", "gravity, restitution"),
        ("basins pendulum", "cam-follower, impact-oscillator"),
        ("basins bouncing-ball", "give its corners"),
        ("basins --shape 4", "one in each"),
        ("basins --shape 4.5,3", "whole numbers"),
        ("diagram --from 130 --to 140 --dwell 60", "such as 60,10"),
        ("basins --shape 4,0", "1 or more"),
        ("basins --turns 10", "--turns is 10"),
        ("basins --low 1,x", "such as 0.34,-2"),
        ("basins --low 0.6,-3", "low below high"),
        ("basins --workers 0", "--workers is 0"),
        ("basins --resume", "--out DIR"),
        ("basins --speed -3", "positive"),
        ("basins --cluster tcp", "local, or the address"),
    ],
)
def test_bad_input_is_one_sentence(line, words):
    found = jaxcam(*line.split())
    assert found.exit_code == 2, found.output
    assert found.stdout == "" and words in found.stderr
    (sentence,) = found.stderr.splitlines()
    assert sentence.endswith(".")
