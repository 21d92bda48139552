"""Recordings cut into pieces that a model can follow."""

import dataclasses

import numpy as np

from jaxcam.fitting.engine._pieces import _PIECE, spans
from jaxcam.recordings import Recording, segment


def test_a_contact_of_which_little_is_sure_is_cut_by_time():
    """Predictions of a piece are interpolated: none may last longer than `_PIECE`.

    Of a long contact every two hundredth sample is beyond doubt; all of them are kept,
    once each.
    """
    time = 5e-4 * np.arange(8000)
    floor = 0.01 * np.sin(12.0 * time)
    height = floor + 1e-4 * np.random.default_rng(1).standard_normal(len(time))
    found = segment(Recording("rest", time, {"height": height}), "height", floor)
    sure = np.arange(len(time)) % 200 < 3
    flown, rested = spans(dataclasses.replace(found, sure=sure))
    assert not flown and len(found.contacts) == 1
    kept = np.concatenate([span.rows for span in rested])
    expected = np.flatnonzero(sure & found.resting(found.contacts[0]))
    assert np.array_equal(np.sort(kept), expected) and len(kept) == len(set(kept))
    longest = max(span.stop - span.start for span in rested)
    assert longest <= _PIECE * 5e-4 * (1 + 1e-9)
