"""Initial states of the pieces of a recording."""

import numpy as np
from swing_rig import PARAMETERS, Swing

from jaxcam.fitting import Model, Problem, Sensor
from jaxcam.fitting.engine._starts import suggested_starts
from jaxcam.recordings import Recording, segment


def test_measured_components_do_not_suffer_from_noisy_slopes():
    """Position and velocity are both measured at twelve times: the initial state is
    within six times the noise (a parabola is known to 1.5 times at its end)."""
    rng, time = np.random.default_rng(5), 2e-3 * np.arange(12)
    swing = Swing(damping=0.0)
    omega = np.sqrt(swing.stiffness)
    truth = np.stack([np.cos(omega * time), -omega * np.sin(omega * time)]) * 0.3
    noise = {"angle_rad": 0.02, "rate_rad_s": 0.2}
    channels = {
        name: row + size * rng.standard_normal(len(time))
        for row, (name, size) in zip(truth, noise.items(), strict=True)
    }
    part = segment(Recording("run", time, channels), "angle_rad", noise=0.02)
    sensors = {
        name: Sensor(place, noise=size)
        for place, (name, size) in enumerate(noise.items())
    }
    problem = Problem.build(Model(swing, sensors), [part], PARAMETERS)
    states, _ = suggested_starts(
        problem.model, problem.segments, problem.spans, problem.pieces
    )
    found = states[0, 0]
    for place, size in enumerate(noise.values()):
        assert abs(found[place] - truth[place, 0]) < 6 * size
