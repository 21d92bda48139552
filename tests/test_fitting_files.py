"""Files in and out: MATLAB, Parquet, saved systems, and the command line."""

import json
import sys

import equinox as eqx
import numpy as np
import pytest
from fitting_rigs import NOMINAL, recorded, TRUTH
from scipy.io import savemat
from typer.testing import CliRunner

from jaxcam import models
from jaxcam.cli._app import app
from jaxcam.data import DEMO_RIG
from jaxcam.recordings import mend, Recording, RecordingError
from jaxcam.recordings.files import read_recordings


def columns():
    time = np.arange(200) * 1e-3
    return {"time_s": time, "angle_deg": 10 * np.sin(20 * time), "note": 3.0}


def test_matlab(tmp_path):
    file = tmp_path / "run_150rpm.mat"
    savemat(file, columns())
    (run,) = read_recordings(file)
    assert run.name == "run_150rpm"
    np.testing.assert_allclose(
        run["angle_rad"], np.deg2rad(columns()["angle_deg"]), rtol=1e-12
    )
    # vectors may be fields of a structure
    savemat(tmp_path / "s.mat", {"log": columns()})
    (inner,) = read_recordings(tmp_path / "s.mat")
    assert len(inner) == 200
    (tmp_path / "text.mat").write_text("no numbers here")
    with pytest.raises(RecordingError, match="not a MATLAB file"):
        read_recordings(tmp_path / "text.mat")
    savemat(
        tmp_path / "nan.mat", {"time_s": np.arange(5.0), "x_m": [1, 2, np.nan, 3, 4]}
    )
    with pytest.raises(RecordingError, match="row 3"):
        read_recordings(tmp_path / "nan.mat")


def test_parquet(tmp_path, monkeypatch):
    file = tmp_path / "run.parquet"
    file.write_bytes(b"PAR1")
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    monkeypatch.setitem(sys.modules, "fastparquet", None)
    with pytest.raises(RecordingError, match="install the package pyarrow"):
        read_recordings(file)


def test_parquet_is_read(tmp_path):
    pytest.importorskip("pyarrow")
    import pandas as pd

    file = tmp_path / "run.parquet"
    table = columns()
    del table["note"]
    pd.DataFrame(table).to_parquet(file)
    (run,) = read_recordings(file)
    np.testing.assert_allclose(run.time, table["time_s"])


def test_mending():
    time = np.arange(1000) * 1e-3
    angle = 12.0 * time
    slipped = angle + np.where(time >= 0.5, 2 * np.pi, 0.0)
    keep = np.ones(1000, bool)
    keep[[100, 101, 300]] = False
    keep[600:650] = False
    run = Recording("run", time[keep], {"cam_angle_rad": slipped[keep]})
    mended = mend(run)
    assert len(mended.recordings) == 2
    first, second = mended.recordings
    assert first.filled is not None and second.filled is None
    assert list(np.flatnonzero(first.filled)) == [100, 101, 300]
    # the marks follow the samples, in a part and when a part is mended again
    part = first.between(0.1, 0.2)
    assert part.filled is not None and list(np.flatnonzero(part.filled)) == [0, 1]
    (again,) = mend(first.between(0.2, 0.4)).recordings
    assert again.filled is not None and list(np.flatnonzero(again.filled)) == [100]
    np.testing.assert_allclose(first["cam_angle_rad"], angle[:600], atol=1e-9)
    np.testing.assert_allclose(second["cam_angle_rad"], angle[650:], atol=1e-9)
    words = " ".join(mended.notes)
    assert "3 samples" in words and "jumps by a turn at 0.5000 s" in words
    assert "51 ms" in words
    # an angle that starts anew each turn is no fault
    wrapped = Recording("run", time, {"cam_angle_rad": np.mod(angle, 2 * np.pi)})
    assert mend(wrapped).notes == ()
    np.testing.assert_allclose(
        mend(wrapped).recordings[0]["cam_angle_rad"], angle, atol=1e-9
    )


@pytest.mark.parametrize(
    "system",
    [
        models.CamFollower(restitution=models.PowerLawRestitution(0.5, 0.3, 0.1)),
        models.CamFollower(
            profile=models.SplineProfile(
                np.linspace(0, 2 * np.pi, 12, endpoint=False), np.linspace(0.2, 0.3, 12)
            )
        ),
        models.ImpactOscillator(omega=2.6),
        models.BouncingBall(gravity=1.6),
        models.TripleIntegrator(),
    ],
)
def test_saved_systems_come_back(tmp_path, system):
    file = tmp_path / "system.json"
    models.save_system(system, file, about={"from": "a test"})
    again = models.load_system(file)
    assert eqx.tree_equal(again, system)
    assert json.loads(file.read_text())["about"] == {"from": "a test"}


def test_saved_systems_are_checked(tmp_path):
    file = tmp_path / "system.json"
    models.save_system(models.BouncingBall(), file)
    good = json.loads(file.read_text())

    def changed(**changes):
        return {**good, **changes}

    inner = good["system"]
    cases = [
        (changed(format="other"), "not a saved system"),
        (changed(version=99), "version 99"),
        (changed(system={**inner, "class": "Popen"}), "'Popen', which is unknown"),
        (changed(system={**inner, "fields": {"gravity": 1.0}}), "lacks"),
    ]
    for found, message in cases:
        file.write_text(json.dumps(found))
        with pytest.raises(ValueError, match=message):
            models.load_system(file)
    file.write_text("{")
    with pytest.raises(ValueError, match="not JSON"):
        models.load_system(file)


@pytest.mark.slow
def test_command_line(tmp_path):
    case = tmp_path / "case"
    case.mkdir()
    for run in recorded():
        rows = zip(run.time, run["cam_angle_rad"], run["follower_angle_rad"])
        lines = [f"{t:.4f},{c:.7f},{f:.7f}" for t, c, f in rows]
        head = "time_s,cam_angle_rad,follower_angle_rad"
        (case / f"{run.name}.csv").write_text("\n".join([head, *lines, ""]))
    fitted, out = tmp_path / "fitted.json", tmp_path / "out"
    runner = CliRunner()
    rig = str(DEMO_RIG / "rig.toml")
    arguments = ["--rig", rig, "--json", str(fitted), "--out", str(out)]
    found = runner.invoke(app, ["fit", str(case), *arguments])
    assert found.exit_code == 0, found.output
    about = json.loads(fitted.read_text())["about"]
    r = next(p for p in about["parameters"] if p["name"] == "restitution")
    assert abs(r["value"] - TRUTH["restitution"]) < 3.3 * r["stderr"]
    assert len(list(out.glob("*.png"))) == 2
    system = models.load_system(fitted)
    assert float(system.restitution.r) == r["value"]
    assert float(system.inertia) == NOMINAL.inertia.value
    again = runner.invoke(
        app, ["simulate", "--system", str(fitted), "--speed", "140", "--turns", "2"]
    )
    assert again.exit_code == 0, again.output
    both = ["simulate", "--system", str(fitted), "--preset", "table-4.4"]
    refused = runner.invoke(app, both)
    assert refused.exit_code == 2
