"""Times that a file writes with few digits; gaps of a drive that turns on."""

import numpy as np
import pytest

from jaxcam.recordings import Recording
from jaxcam.recordings.files._clock import unrounded
from jaxcam.recordings.files._mend import mend


@pytest.mark.parametrize(
    ("rate", "digits"),
    [(1500, 4), (3000, 4), (2048, 4), (2048, 6), (6000, 4), (8000, 4), (300, 3)],
)
@pytest.mark.parametrize("dropped", [False, True])
def test_rounded_times_are_put_back_on_their_clock(rate, digits, dropped):
    """The interval to 1e-4 of itself, the times to half of what rounding took."""
    true = 0.37 + np.arange(4 * rate) / rate
    keep = np.ones(len(true), dtype=bool)
    # with 1.25 digits between samples a dropped one cannot be told
    if dropped and rate < 8000:
        keep[[100, 101, 300, 2 * rate]] = False
        keep[3 * rate : 3 * rate + rate // 3] = False
    time = unrounded(np.round(true[keep], digits))
    assert np.median(np.diff(time)) == pytest.approx(1 / rate, rel=1e-4)
    assert np.max(np.abs(time - true[keep])) < 0.25 * 10.0**-digits


@pytest.mark.parametrize("missing", [[500], [2500], [1250, 3750], [800, 2500, 4200]])
def test_missing_samples_do_not_move_the_others(missing):
    """A sample every millisecond, written with three digits: the line through all
    samples is within 0.75 ms of the times, although a few are missing."""
    time = np.round(np.delete(np.arange(5000) * 1e-3, missing), 3)
    np.testing.assert_allclose(unrounded(time), time, rtol=0, atol=1e-9)


def test_times_that_are_no_even_clock_are_left_alone():
    even = np.arange(2000) * 5e-4
    rng = np.random.default_rng(0)
    for time in (
        even,
        np.round(even + 1e-4 * rng.uniform(-1, 1, 2000), 6),
        np.round(np.linspace(0.0, 1.0, 2000) ** 1.1, 4),
        np.cumsum(rng.uniform(0.5, 1.5, 2000)),
        np.array([0.0, 0.3333, 0.6667, 1.0]),
    ):
        assert unrounded(time) is time


def test_mending_keeps_every_sample_of_an_uneven_clock():
    """Samples up to 0.2 intervals early or late are neither lost nor multiplied."""
    rng = np.random.default_rng(0)
    time = 5e-4 * (np.arange(8000) + 0.2 * rng.uniform(-1, 1, 8000))
    run = Recording("run", time, {"cam_angle_rad": 15.0 * time})
    (piece,) = mend(run).recordings
    np.testing.assert_array_equal(piece.time, time)
    np.testing.assert_array_equal(piece["cam_angle_rad"], 15.0 * time)


@pytest.mark.parametrize("turns", ["on", "anew"])
def test_a_drive_that_turns_on_during_a_gap_has_not_slipped(turns):
    time = np.arange(8000) * 5e-4
    time = time[(time < 1.0) | (time > 2.1)]
    angle = 15.0 * time if turns == "on" else (15.0 * time) % (2 * np.pi)
    mended = mend(Recording("run", time, {"cam_angle_rad": angle}))
    assert len(mended.recordings) == 2
    assert not any("jumps" in note for note in mended.notes)
    for piece in mended.recordings:
        off = piece["cam_angle_rad"] - 15.0 * piece.time
        np.testing.assert_allclose(np.exp(1j * off), 1.0, atol=1e-9)
