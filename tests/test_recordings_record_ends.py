"""Impacts within the first samples of a recording."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jaxcam.recordings.cut._motion import Motion
from jaxcam.recordings.cut._record_ends import clear_of_end


NOISE, INTERVAL = 4e-6, 5e-4


def motion_of(gap, tail=200):
    """A gap that has been recorded, followed by a long flight; its noise is known."""
    rest = gap[-1] + 1e-3 * (1 + np.arange(tail))
    samples = np.concatenate([gap, rest])
    time = INTERVAL * np.arange(len(samples))
    none = np.zeros(len(samples))
    return Motion(time, samples, none, none, NOISE, INTERVAL)


@given(st.integers(0, 10_000))
@settings(max_examples=60, deadline=None)
def test_a_short_flight_without_an_impact_is_kept(seed):
    """Flights of 13 to 31 samples that swing at up to 13 Hz, 2500 times the noise."""
    rng = np.random.default_rng(seed)
    count, rate = int(rng.integers(13, 32)), rng.uniform(20.0, 80.0)
    time = INTERVAL * np.arange(count)
    gap = 0.01 * np.cos(rate * time + rng.uniform(0, 6)) + NOISE * rng.normal(
        size=count
    )
    motion = motion_of(gap)
    assert clear_of_end(motion, (0, count)) == (0, count)


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize("place", [0.7, 2.4, 3.3, 4.9])
def test_the_samples_before_an_early_impact_are_left_out(place, reverse):
    """Velocity jump of 0.9 m/s after `place` samples of 22: the flight begins, or ends
    in the reversed recording, within two samples of it.
    """
    rng, count = np.random.default_rng(1), 22
    time = np.arange(count)
    gap = 4e-4 * np.abs(time - place) + 1e-6 * time**2 + NOISE * rng.normal(size=count)
    motion = motion_of(gap)
    first, last = 0, count
    if reverse:
        whole = motion.samples[::-1]
        motion = Motion(
            motion.time, whole, motion.contact, motion.rate, NOISE, INTERVAL
        )
        first, last = len(whole) - count, len(whole)
    begin, end = clear_of_end(motion, (first, last))
    left_out = last - end if reverse else begin - first
    assert place < left_out <= place + 2.5
    assert end - begin == count - left_out
