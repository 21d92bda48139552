"""Each recording may have a value of its own, such as an unknown phase of its drive."""

import json

import driven_wall
import hostile_files
import numpy as np
import pytest
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.search import segmented, setup_question
from jaxcam.fitting import read_setup
from jaxcam.recordings import RigError


OWN = 'phase = {value = 0.0, tolerance = 3.2, per_record = true, unit = "rad"}'
# what a user sees, whose types nothing checks
pytestmark = pytest.mark.usefixtures("unchecked_types")


def with_phase(text: str) -> str:
    return driven_wall.RIG.replace("mass = 0.5\n", f"mass = 0.5\n{text}\n")


def test_phases_are_fitted_for_each_recording(tmp_path):
    """With these phases, a fit that starts at zero alone ends at a wrong optimum, 200
    times the noise; each phase is within four of its standard errors."""
    phases = (2.0, 2.6)
    rig = driven_wall.write_rig(tmp_path, with_phase(OWN))
    case = driven_wall.write_case(tmp_path / "case", phases)
    words = ["fit", str(case), "--rig", str(rig), "--json", str(tmp_path / "f.json")]
    found = CliRunner().invoke(app, words)
    assert found.exit_code == 0, found.output
    assert "phase (rad, run_B)" in found.output
    # the table of correlations tells the two phases apart
    assert "phase@run_B" in found.output.split("Strongest correlations")[1]
    written = json.loads((tmp_path / "f.json").read_text())
    (rows,) = (part for part in _all(written, "parameters") if isinstance(part, list))
    own = [one for one in rows if one["name"] == "phase"]
    assert [one["record"] for one in own] == ["run_A", "run_B"]
    for one, phase in zip(own, phases, strict=True):
        off = np.angle(np.exp(1j * (one["value"] - phase)))
        assert abs(off) < 4 * one["stderr"] < 2e-3


def test_a_diagnosis_finds_the_phases_first(tmp_path):
    """Otherwise terms would make up for wrong phases: the start is within 0.05 rad, and
    the rig file's value remains the nominal one."""
    phases = (2.0, 2.6)
    setup = read_setup(driven_wall.write_rig(tmp_path, with_phase(OWN)))
    case = setup.read_case(driven_wall.write_case(tmp_path / "case", phases))
    parts = segmented(setup, case, _say_nothing, {})
    question = setup_question(*parts, (), _say_nothing, Policy())
    column = question.problem.names.index("phase")
    off = np.asarray(question.problem.start.values)[:, column] - np.array(phases)
    assert np.all(np.abs(np.angle(np.exp(1j * off))) < 0.05)
    assert question.problem.parameter("phase").nominal == 0.0


def _say_nothing(sentence, fraction=None):
    del sentence, fraction


def _all(tree, key: str):
    if isinstance(tree, dict):
        for name, part in tree.items():
            if name == key:
                yield part
            yield from _all(part, key)


@pytest.mark.parametrize(
    "old, new, said",
    [
        (
            "frequency = 4.7\n",
            "frequency = 4.7\nphase = {value = 0.0, tolerance = 3.2}\n",
            "per_record = true",
        ),
        ("mass = 0.5\n", "mass = {value = 0.5, per_record = true}\n", "no tolerance"),
        (
            "mass = 0.5\n",
            "mass = {value = 0.5, tolerance = 0.1, per_record = 3}\n",
            "true or false",
        ),
        (
            "mass = 0.5\n",
            'mass = {value = 500.0, unit = "mm/s^2"}\n',
            r'SI units; use value = 0.5, unit = "m/s\^2"',
        ),
        (
            "mass = 0.5\n",
            'mass = {value = 500.0, tolerance = 20.0, lower = 0, unit = "mm"}\n',
            "use value = 0.5, tolerance = 0.02, lower = 0, unit",
        ),
        (
            "frequency = 4.7\n",
            'frequency = 4.7\nphase = {value = 30.0, unit = "deg"}\n',
            'use value = 0.523599, unit = "rad"',
        ),
        ("mass = 0.5\n", 'mass = {value = 5.0, unit = "N/mm"}\n', "m, s, rad and N"),
    ],
)
def test_values_that_contradict_each_other_are_refused(tmp_path, old, new, said):
    assert old in driven_wall.RIG
    file = driven_wall.write_rig(tmp_path, driven_wall.RIG.replace(old, new))
    with pytest.raises(RigError, match=said) as caught:
        read_setup(file)
    hostile_files.said(caught.value)
