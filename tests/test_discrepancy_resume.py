"""A diagnosis that is interrupted goes on, and says the same."""

import dataclasses

import equinox as eqx
import numpy as np
import pytest
from fitting_rigs import NOMINAL, recorded
from typer.testing import CliRunner

from jaxcam.cli import app
from jaxcam.data import DEMO_RIG
from jaxcam.discrepancy import diagnose, Policy
from jaxcam.discrepancy.search._kept_trials import Ended, KeptTrials
from jaxcam.discrepancy.terms import system_with_terms
from jaxcam.fitting import cam_follower_model, cam_follower_parameters, Problem
from jaxcam.recordings import segment_case


@pytest.fixture(scope="module")
def problem():
    runs = segment_case(recorded(), NOMINAL)
    plain = cam_follower_model(NOMINAL)
    built = Problem.build(plain, runs, cam_follower_parameters(NOMINAL))
    # the model of a diagnosis has terms, of which the mark of a file contains all
    system = system_with_terms(plain.system, ())
    model = eqx.tree_at(lambda m: m.system, plain, system)
    return dataclasses.replace(built, model=model)


@pytest.mark.slow
def test_what_is_kept_comes_back_for_the_same_problem_only(problem, tmp_path):
    kept = KeptTrials(tmp_path, problem)
    assert kept.get({"viscous_damping"}) is None
    kept.put({"viscous_damping", "sensor_lag"}, Ended(problem.start, True, 7))
    found = kept.get(["sensor_lag", "viscous_damping"])
    assert found is not None
    np.testing.assert_array_equal(found.point.values, problem.start.values)
    np.testing.assert_array_equal(found.point.states, problem.start.states)
    assert (found.converged, found.iterations) == (True, 7)
    assert found.point.discrete is None
    modes = np.arange(problem.pieces.joint.size).reshape(problem.pieces.joint.shape)
    kept.put((), Ended(problem.start._replace(discrete=modes), True, 7))
    again = kept.get(())
    assert again is not None
    np.testing.assert_array_equal(again.point.discrete, modes)
    moved = dataclasses.replace(
        problem, start=problem.start._replace(values=problem.start.values + 1e-9)
    )
    assert KeptTrials(tmp_path, moved).get({"viscous_damping", "sensor_lag"}) is None
    other = KeptTrials(tmp_path, problem, Policy(iterations=61))
    assert other.get({"viscous_damping", "sensor_lag"}) is None


@pytest.mark.slow
def test_a_file_that_was_cut_off_is_passed_over(problem, tmp_path):
    kept = KeptTrials(tmp_path, problem)
    kept.put((), Ended(problem.start, False, 15))
    file = tmp_path / "none.npz"
    whole = file.read_bytes()
    for length in (0, 1, 40, len(whole) // 2, len(whole) - 1):
        file.write_bytes(whole[:length])
        assert kept.get(()) is None


def test_what_an_interrupted_run_left_is_not_replaced(tmp_path):
    (tmp_path / "fits").mkdir()
    (tmp_path / "fits" / "none.npz").write_bytes(b"something")
    line = ["diagnose", str(DEMO_RIG), "--out", str(tmp_path)]
    found = CliRunner().invoke(app, line)
    assert found.exit_code == 2 and "add --resume" in " ".join(found.output.split())
    assert (tmp_path / "fits" / "none.npz").exists()


@pytest.mark.slow
def test_interrupted_and_resumed(tmp_path):
    """Verdict and every number as without interruption, to a thousandth of an error."""
    runs = recorded(seed=5)
    whole = diagnose(NOMINAL, runs)
    calls = []

    def stop(sentence, fraction):
        calls.append(sentence)
        if sentence.startswith("drawing bootstrap"):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        diagnose(NOMINAL, runs, progress=stop, keep=tmp_path / "fits")
    assert list((tmp_path / "fits").glob("*.npz"))
    again = diagnose(NOMINAL, runs, keep=tmp_path / "fits")
    assert not (tmp_path / "fits").exists()
    assert (again.verdict, again.names) == (whole.verdict, whole.names)
    for one in whole.after.estimates:
        assert abs(again.after[one.name].value - one.value) < 1e-3 * one.stderr
