"""Commands that are stopped at any time, or started twice: nothing is lost or mixed."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import continuation
from jaxcam.data import DEMO_RIG
from jaxcam.sweeps import load_sweep


#: each takes a few seconds once it is compiled, and stores what it has as it goes
LINES = {
    "diagram": (
        "diagram impact-oscillator --parameter omega --from 2.6 --to 2.9 --points 96 "
        "--turns 400 --keep 20 --state=-0.5,0"
    ),
    "basins": "basins impact-oscillator --shape 48,256 --turns 60 --keep 20",
    "continue": (
        "continue impact-oscillator --parameter wall --at 0.2 --from 0.12 --to 0.3 "
        "--state=-0.1462,0 --set damping=0.05"
    ),
}
STORED = {
    "diagram": "diagram.zarr",
    "basins": "basins.zarr",
    "continue": "branch.jsonl",
}


def start(line: str, out: Path, *more: str) -> subprocess.Popen:
    command = "from jaxcam.cli import main; main()"
    arguments = [sys.executable, "-c", command, *line.split(), "--out", str(out), *more]
    return subprocess.Popen(
        arguments,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )


def begun(name: str, out: Path) -> bool:
    """Whether a command has stored anything; a branch begins with its back half."""
    return (out / STORED[name]).exists() or (out / "branch.back.jsonl").exists()


def finish(process: subprocess.Popen) -> str:
    """The error stream of a process that ends well."""
    _, errors = process.communicate(timeout=600)
    assert process.returncode == 0, errors
    return errors


def content(name: str, out: Path):
    """What a command stored, as something that can be compared."""
    if name == "continue":
        points = continuation.load_branch(out / STORED[name]).points
        back = continuation.load_branch(out / "branch.back.jsonl").points
        return [(p.label, p.kind, p.parameter, p.state.tolist()) for p in back + points]
    made = load_sweep(out / STORED[name]).dataset
    return {str(k): np.asarray(v) for k, v in made.variables.items()}


def same(one, other) -> bool:
    if isinstance(one, list):
        return one == other
    return one.keys() == other.keys() and all(
        np.array_equal(v, other[k], equal_nan=v.dtype.kind == "f")
        for k, v in one.items()
    )


@pytest.fixture(scope="module", params=list(LINES))
def whole(request, tmp_path_factory):
    """A command, what it stores without an interruption, and how long it takes (s)."""
    name, out = request.param, tmp_path_factory.mktemp("whole") / "out"
    begin = time.monotonic()
    finish(start(LINES[name], out))
    first = time.monotonic() - begin
    begin = time.monotonic()
    finish(start(LINES[name], out.with_name("again")))
    return name, content(name, out), min(first, time.monotonic() - begin)


@pytest.mark.slow
@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_stopped_at_random_and_resumed(whole, how, tmp_path):
    name, wanted, seconds = whole
    draw, out = random.Random(f"{name}{how}"), tmp_path / "out"
    stopped = 0
    for _ in range(9):
        more = ["--resume"] if begun(name, out) else []
        process = start(LINES[name], out, *more)
        time.sleep(seconds * draw.uniform(0.2, 1.0))
        process.send_signal(how)
        _, errors = process.communicate(timeout=60)
        if process.returncode == 0:
            if stopped:
                break
            # it was faster than the run that was timed
            shutil.rmtree(out)
            seconds *= 0.7
            continue
        stopped += 1
        if how == signal.SIGINT:
            # before Python has read the command there is nobody to say a sentence
            read = "Traceback" not in errors or "jaxcam/cli/_errors.py" not in errors
            assert read, errors
            assert process.returncode in (130, -signal.SIGINT, 1), errors
        if stopped == 3:
            break
    assert stopped
    more = ["--resume"] if begun(name, out) else []
    finish(start(LINES[name], out, *more))
    assert same(content(name, out), wanted)


@pytest.mark.slow
def test_two_on_one_folder(whole, tmp_path):
    """The second says what is the matter; the first ends as if it were alone."""
    name, wanted, _ = whole
    out = tmp_path / "out"
    first = start(LINES[name], out)
    while not (out / STORED[name]).exists() and first.poll() is None:
        time.sleep(0.05)
    second = start(LINES[name], out, "--resume")
    _, errors = second.communicate(timeout=600)
    alone = first.poll() is not None
    finish(first)
    if second.returncode == 2:
        (sentence,) = errors.splitlines()
        assert "another jaxcam process is writing" in sentence
    else:
        # it came when the first had gone
        assert alone and second.returncode == 0, errors
    assert same(content(name, out), wanted)


@pytest.mark.slow
def test_a_diagnosis_that_is_killed_goes_on(tmp_path):
    """Names as without interruption, parameters to a thousandth of their errors.

    Beside it a second one on the same folder says what is the matter.
    """
    case = tmp_path / "case"
    case.mkdir()
    for name in ("rig.toml", "run2_146.0rpm.csv.gz", "run3_158.0rpm.csv.gz"):
        shutil.copy(DEMO_RIG / name, case)
    line = f"diagnose {case} --no-predict"
    begin = time.monotonic()
    finish(start(line, tmp_path / "whole"))
    alone = time.monotonic() - begin
    out = tmp_path / "out"
    process = start(line, out)
    while not list((out / "fits").glob("*.npz")) and process.poll() is None:
        time.sleep(0.05)
    second = start(line, out, "--resume")
    _, errors = second.communicate(timeout=600)
    (sentence,) = errors.splitlines()
    assert second.returncode == 2 and "another jaxcam process is writing" in sentence
    # some way into the fits
    time.sleep(random.Random(4).uniform(0.1, 0.3) * alone)
    process.kill()
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL
    assert list((out / "fits").glob("*.npz"))
    finish(start(line, out, "--resume"))
    assert not (out / "fits").exists()
    files = [out, tmp_path / "whole"]
    again, whole = (json.loads((f / "verdict.json").read_text()) for f in files)
    assert again["verdict"] == whole["verdict"]
    names = [[one["name"] for one in found["effects"]] for found in (again, whole)]
    assert names[0] == names[1]
    for name, one in whole["rig"].items():
        assert abs(again["rig"][name]["value"] - one["value"]) <= 1e-3 * one["stderr"]
