"""The record that is proposed, made and fitted: did it say what was predicted?"""

import numpy as np
import pytest

from benchmarks._made_rigs import made_rig
from benchmarks.unnamed import hidden_case
from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import DEMO_SENSORS, measure, RealRig, simulate_rig
from jaxcam.discrepancy import diagnose, next_experiments
from jaxcam.discrepancy.report import slopes_of_function
from jaxcam.fitting import fit, Problem
from jaxcam.recordings import read_case, read_rig, Recording, segment_case


@pytest.mark.slow
def test_the_proposed_record_says_what_was_predicted():
    """Standard error of the damping with the record made after all, within 15 %.

    It is made by the simulator of the demonstration, which shares nothing with ours.
    """
    rig, runs = read_rig(DEMO_RIG / "rig.toml"), tuple(read_case(DEMO_RIG))
    found = diagnose(rig, runs)
    proposed = next_experiments(found, rig)
    factors = [one.factor for one in proposed]
    assert factors == sorted(factors)
    assert factors[0] < 0.5 < factors[-1] < 1
    best = proposed[0]
    assert best.speed is not None
    truth = simulate_rig(RealRig(), best.speed, 4.0)
    rng = np.random.default_rng(5)
    cam_noise, cam_counts, noise, counts = DEMO_SENSORS
    made = Recording(
        "next",
        truth.time,
        {
            "cam_angle_rad": measure(truth.turned, cam_noise, int(cam_counts), rng),
            "follower_angle_rad": measure(truth.angle, noise, int(counts), rng),
        },
        best.speed,
    )
    old = found.after.problem
    problem = Problem.build(old.model, segment_case((*runs, made), rig), old.parameters)
    again = fit(problem, free=found.after.free, start=None, iterations=60)
    assert again.converged
    assert again["c1"].stderr == pytest.approx(best.then["c1"], rel=0.15)
    assert abs(again["c1"].value - 0.3) < 4 * again["c1"].stderr


@pytest.mark.slow
def test_records_are_ranked_by_the_band_of_a_function():
    """Its rms so far is that of the fit, to 5 %; every record makes it smaller.

    The rig and what is hidden in it are simulated by scipy.
    """
    rig = made_rig("two_stops")
    _, runs, _, _ = hidden_case(rig, "stop", 0)
    found = diagnose(rig.given, runs)
    (one,) = found.missing
    assert (one.kind, one.arguments) == ("force", ("position",))
    proposed = next_experiments(found, rig.given)
    factors = [each.factor for each in proposed]
    assert factors == sorted(factors) and factors[-1] < 1
    best = proposed[0]
    assert list(best.now) == ["force as a function of position"]
    assert best.now["force as a function of position"] == pytest.approx(
        np.sqrt(np.mean(_band(found.after, one) ** 2)), rel=0.05
    )


def _band(found, one):
    """Standard errors of a function along its argument."""
    slopes = slopes_of_function(found, one)
    rows = [[e.name for e in found.estimates].index(name) for name in one.numbers]
    covariance = found.covariance[np.ix_(rows, rows)]
    return np.sqrt(np.einsum("kp,pq,kq->k", slopes, covariance, slopes))
