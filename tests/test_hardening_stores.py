"""Stored branches, sweeps and reproduced tables that were damaged or tampered with."""

import json
import math
import shutil
from pathlib import Path

import hostile_files as hostile
import numpy as np
import pytest
import zarr
from continuation_examples import fold_field, mu
from hypothesis import example, given, HealthCheck, settings, strategies as st
from sweep_maps import SQUARE_ROOT

import continuation
from jaxcam.cli._reproduce_record import (
    by_other_code,
    earlier,
    Origin,
    TargetRecord,
    write,
)
from jaxcam.sweeps import basins, Grid, load_sweep


# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")

FEW = settings(max_examples=60, suppress_health_check=list(HealthCheck))
OPTIONS = {"turns": 40, "block": 3}
GRID = Grid((-2, -2), (2, 2), (12, 5))


@pytest.fixture(scope="module")
def branch_text(tmp_path_factory):
    file = tmp_path_factory.mktemp("branch") / "branch.jsonl"
    problem = continuation.Equilibrium(fold_field, {"mu": 1.0})
    continuation.branch(problem, [1.0], mu, (-1.0, 2.0), direction=-1, out=file)
    return file.read_text()


@FEW
@given(data=st.data())
def test_any_branch(branch_text, tmp_path_factory, data):
    lines = branch_text.splitlines()
    k = data.draw(st.integers(0, len(lines) - 1))
    how = data.draw(st.sampled_from(["altered", "altered", "torn"]))
    if how == "torn":
        raw = data.draw(hostile.torn(branch_text.encode()))
    else:
        lines[k] = json.dumps(data.draw(hostile.altered(json.loads(lines[k]))))
        raw = hostile.encoded("\n".join(lines) + "\n", "utf-8")
    file = tmp_path_factory.getbasetemp() / "branch.jsonl"
    file.write_bytes(raw)
    try:
        continuation.load_branch(file)
    except ValueError as error:
        sentence = str(error)
        assert str(file) in sentence and "\n" not in sentence
        assert error.__cause__ is None and len(sentence) < 400


@pytest.mark.parametrize(
    ("name", "value"),
    [("converged", {}), ("label", "2"), ("stable", 1.5), ("reason", None)],
)
def test_a_point_with_a_field_of_another_type(branch_text, tmp_path, name, value):
    header, first, *rest = branch_text.splitlines()
    altered = json.dumps({**json.loads(first), name: value})
    file = tmp_path / "branch.jsonl"
    file.write_text("\n".join([header, altered, *rest]) + "\n")
    with pytest.raises(ValueError, match="is damaged"):
        continuation.load_branch(file)


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    folder = tmp_path_factory.mktemp("stored") / "sweep"
    made = basins(SQUARE_ROOT, GRID, out=folder, **OPTIONS)
    return folder, made.attractor


@settings(max_examples=25, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_any_store(stored, tmp_path_factory, data):
    """A damaged store is named, or resumed to what it was; never read as it is."""
    whole, attractor = stored
    folder = tmp_path_factory.getbasetemp() / "sweep"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(whole, folder)
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    file = data.draw(st.sampled_from(files))
    raw = file.read_bytes()
    if file.name == "zarr.json" and data.draw(st.booleans()):
        found = data.draw(hostile.altered(json.loads(raw)))
        file.write_bytes(hostile.encoded(json.dumps(found), "utf-8"))
    elif data.draw(st.booleans()):
        file.write_bytes(data.draw(hostile.torn(raw)))
    else:
        file.unlink()
    changed = not file.exists() or file.read_bytes() != raw
    try:
        found = load_sweep(folder)
        # what is no part of the numbers may be lost, such as an attribute
        assert np.array_equal(found.attractor, attractor) or not changed
    except ValueError as error:
        assert "\n" not in str(error)
    try:
        found = basins(SQUARE_ROOT, GRID, out=folder, resume=True, **OPTIONS)
        assert np.array_equal(found.attractor, attractor)
    except ValueError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize("axis", ["x1", "x2"])
@pytest.mark.parametrize("how", ["lost", "moved"])
def test_a_store_without_its_axes_is_damaged(stored, tmp_path, axis, how):
    # an axis that is lost was once read as 0, 1, 2, ...
    folder = tmp_path / "sweep"
    shutil.copytree(stored[0], folder)
    if how == "lost":
        (folder / axis / "zarr.json").unlink()
    else:
        group = zarr.open_group(str(folder), mode="r+")
        group[axis][:1] = 0.5
    with pytest.raises(ValueError, match="coordinates"):
        load_sweep(folder)
    with pytest.raises(ValueError, match="coordinates"):
        basins(SQUARE_ROOT, GRID, out=folder, resume=True, **OPTIONS)


@FEW
@given(data=st.data())
@example(data=None)
def test_any_record_of_a_table(tmp_path_factory, data):
    """What is not a complete record of the same settings is computed again."""
    folder = tmp_path_factory.getbasetemp()
    wanted = Origin("1", "calibrated", "full", code="mark")
    row = dict.fromkeys(("printed", "computed", "difference", "relative"), 1.0)
    rows = [{"quantity": "speed", **row, "unit": "rpm"}]
    write(TargetRecord("table", wanted, 1.0, rows), folder)
    if data is None:
        found = earlier(folder, "table", wanted)
        assert found is not None and found.rows == rows
        return
    file = Path(folder) / "table.json"
    text = json.dumps(data.draw(hostile.altered(json.loads(file.read_text()))))
    file.write_bytes(hostile.encoded(text, "utf-8"))
    assert by_other_code(folder, ["table"], wanted) in ([], ["table"])
    found = earlier(folder, "table", wanted)
    if found is not None:
        assert found.settings == wanted and not math.isnan(len(found.table))
        assert found.name == "table" and isinstance(found.seconds, float)
