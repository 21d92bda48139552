"""Speeds before and after impacts, estimated from few samples per period."""

import numpy as np
import pytest

from jaxcam.recordings import Recording, segment


PERIOD = 0.27
ANGLE = 2.4
"""Half of the phase that an oscillator passes between two impacts (rad): between pi/2,
where the stop is at the equilibrium, and pi, where it is never hit.
"""
RATE = 2 * ANGLE / PERIOD
APPROACH = RATE * np.sin(ANGLE)


def oscillator(per_period, noise, scale):
    """Return an undamped oscillator that rebounds elastically from one stop, sampled
    at moments that shift from one period to the next.
    """
    time = np.arange(30 * per_period) * PERIOD / (per_period + 0.37)
    phase = RATE * (np.mod(time, PERIOD) - PERIOD / 2)
    gap = np.cos(phase) - np.cos(ANGLE)
    gap = np.random.default_rng(0).normal(gap, noise)
    return Recording("oscillator", scale * time, {"gap_m": gap})


@pytest.mark.parametrize("scale", (1.0, 10.0))
@pytest.mark.parametrize("per_period", (40, 100, 200))
def test_speeds_at_impacts_are_not_biased(per_period, scale):
    # a cubic through a tenth of a second, or a parabola through 16 samples, does not
    # follow the motion: its slope at the impact is up to 60 % too large
    noise = 2e-4
    run = oscillator(per_period, noise, scale)
    impacts = segment(run, "gap_m", 0.0, noise=noise).impacts
    assert impacts.count >= 28
    for speed in (impacts.approach, impacts.separation):
        error = scale * speed / APPROACH - 1
        # the standard errors are 0.3 to 1 %; what a polynomial that is thought to
        # follow the motion misses may be as large
        assert abs(np.median(error)) < 0.012
        assert np.sqrt(np.mean(error**2)) < 0.03
    # the rough coefficient of restitution is that of the stop
    assert abs(np.median(impacts.restitution) - 1) < 0.015


def test_a_cubic_still_describes_many_samples():
    # in 0.1 s there are 185 samples; a stretch is shortened until a cubic follows it
    noise = 2e-4
    impacts = segment(oscillator(500, noise, 1.0), "gap_m", 0.0, noise=noise).impacts
    error = impacts.approach / APPROACH - 1
    assert abs(np.median(error)) < 0.005
