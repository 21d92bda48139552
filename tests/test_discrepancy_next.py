"""The record that is proposed, made and fitted: did it say what was predicted?"""

import numpy as np
import pytest

from jaxcam.data import DEMO_RIG
from jaxcam.data.make_demo import DEMO_SENSORS, measure, RealRig, simulate_rig
from jaxcam.discrepancy import diagnose, next_experiments
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
