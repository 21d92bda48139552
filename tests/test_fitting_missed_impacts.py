"""Impacts that a segmentation without a model misses."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks._made_rigs import made_rig
from benchmarks._own_rig_makers import Accumulates, made_case
from benchmarks.named import hidden_case
from benchmarks.own_rigs import drawn
from jaxcam.fitting import fit, read_setup
from jaxcam.recordings import Recording
from jaxcam.recordings.cut import segment_gaps


RIGS = Path(__file__).parents[1] / "docs" / "rigs"


def test_a_slow_impact_at_the_turning_point_of_a_stiff_oscillation_is_found():
    """Its time to three samples: a cubic through the flight gives the wrong sign of the
    approach speed.
    """
    omega, speed, restitution, noise, hit = 51.0, 0.009, 0.6, 4.4e-6, 0.2
    time = 5e-4 * np.arange(800)
    later = np.maximum(time - hit, 0)
    center = 3.1e-3
    before = center - center * np.cos(omega * (time - hit))
    gap = before - speed / omega * np.sin(omega * (time - hit))
    jump = (1 + restitution) * speed / omega * np.sin(omega * later)
    gap = gap + np.where(time > hit, jump, 0.0)
    gap = gap + noise * np.random.default_rng(0).standard_normal(len(time))
    # only this turning point; at the others, the wall is not reached
    rows = (time > hit - 0.1) & (time < hit + 0.1)
    run = Recording("slow", time[rows], {"gap_m": gap[rows]})
    found = segment_gaps(run, "gap_m", gap[rows][None], [0.0])
    times = found.impacts.time
    assert len(times) == 1
    assert abs(times[0] - hit) < 3 * 5e-4


@pytest.fixture(scope="module")
def bouncing():
    """A pendulum that bounces ever lower, and leaves the wall again."""
    setup = read_setup(RIGS / "pendulum_wall.toml")
    rng = np.random.default_rng(45)
    while True:
        truth = drawn(setup, rng)
        try:
            made = made_case("pendulum_wall", setup, truth, rng, ())
        except Accumulates:
            continue
        return setup, [run for run, _ in made], [motion for _, motion in made]


def test_a_flight_begins_after_the_last_low_bounce(bouncing):
    """The bounce before it is 2.3 noises high; the model shows where it ends."""
    setup, runs, motions = bouncing
    part = setup.segments(runs)[3]
    times = motions[3].struck[:, 0]
    last = times[(times > 0.48) & (times < 0.5)]
    assert len(last) == 1
    (flight,) = [one for one in part.flights if one.start.time < 0.6 < one.stop.time]
    assert last[0] < flight.start.time < last[0] + 0.03


def test_low_bounces_leave_no_misfit(bouncing):
    """The cost of a sample is 1, to 1 per cent."""
    setup, runs, _ = bouncing
    found = fit(setup.problem(runs))
    assert found.converged
    assert abs(found.cost / found.problem.samples - 1) < 0.01


@pytest.mark.slow
def test_a_slow_impact_that_polynomials_contradict_is_found_by_the_model():
    """A boundary within 3 ms of each impact on the wall. One of them, at 1.452 s, is so
    slow that polynomials fitted to both flights give the wrong sign of the approach
    speed.
    """
    made = made_rig("two_masses")
    _, _, runs, motions = hidden_case(made, "nonlinear_spring", None, 4701)
    for part, motion in zip(made.given.segments(runs), motions):
        pairs = [(flight.start.time, flight.stop.time) for flight in part.flights]
        off = np.abs(np.ravel(pairs)[:, None] - motion.struck[:, 0])
        assert np.all(np.min(off, axis=0) < 3e-3)
