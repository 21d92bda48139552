"""Structures that differ from recording to recording, with quadratic likelihoods."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.evidence import not_shared, Structure
from jaxcam.discrepancy.search import Blocks, predicted_gain, separate_gain


POLICY = Policy()
FREE, NEW = np.array([0]), np.array([1, 2, 3])


def recordings(rng, effects, shares=(1.0, 1.0, 1.0, 1.0)):
    """The likelihood of a parameter common to four recordings and of three new ones,
    whose true values in each recording are given; 200 samples of unit noise each.

    `shares` scales the size of the regressors of the last new parameter."""
    information, score = [], []
    for effect, share in zip(effects, shares):
        design = rng.normal(size=(200, 4)) * np.array([1.0, 1.0, 1.0, share])
        seen = design @ np.concatenate([[0.3], effect]) + rng.normal(size=200)
        information.append(design.T @ design)
        score.append(design.T @ seen)
    names = ("common", "a", "b", "c")
    return Blocks(
        names,
        np.ones(4),
        ("run1", "run2", "run3", "run4"),
        np.zeros(4),
        np.array(information),
        np.array(score),
        np.zeros(4),
        np.zeros(4),
        np.zeros(4, int),
    )


def test_common_effects_gain_by_separate_values_as_chance_says(unchecked_types):
    """Over 300 draws the mean is that of chi-squared with 3 x 3 degrees of freedom to
    four standard errors, and 1 % (0 to 3 %) exceed its 99 % quantile."""
    rng = np.random.default_rng(0)
    gains = []
    for _ in range(300):
        found = recordings(rng, [[0.5, -0.2, 0.4]] * 4)
        gain, count = separate_gain(found, FREE, NEW, POLICY)
        assert count == 9
        gains.append(gain)
    assert np.mean(gains) == pytest.approx(9, abs=4 * np.sqrt(18 / 300))
    assert np.mean(np.array(gains) > chi2.isf(0.01, 9)) < 0.03


def test_separate_values_gain_what_a_fit_of_each_recording_does(unchecked_types):
    """Against least squares with a column for each recording, to rounding."""
    effects = [[1.0, 0.0, 0.2], [-1.0, 0.1, 0.0], [0.3, 0.5, 0.0], [0.0, 0.0, -0.4]]
    found = recordings(np.random.default_rng(1), effects)
    gain, _ = separate_gain(found, FREE, NEW, POLICY)
    whole, right = np.zeros((13, 13)), np.zeros(13)
    for k in range(4):
        rows = np.array([0, 1 + 3 * k, 2 + 3 * k, 3 + 3 * k])
        whole[np.ix_(rows, rows)] += found.information[k]
        right[rows] += found.score[k]
    information, score = found.total()
    common = score @ np.linalg.solve(information, score)
    assert gain == pytest.approx(right @ np.linalg.solve(whole, right) - common)
    assert predicted_gain(found, FREE, NEW, POLICY) < 0


def test_an_effect_that_one_half_hardly_shows_does_not_differ(unchecked_types):
    """A common effect that recordings 2 and 4 show with a fortieth of the amplitude:
    the halves do not predict each other in more than 5 % of 100 draws, but separate
    values gain no more than chance allows in at least 95 %."""
    rng, lost, differing = np.random.default_rng(2), 0, 0
    for _ in range(100):
        shares = (1.0, 0.025, 1.0, 0.025)
        found = recordings(rng, [[0.0, 0.0, 0.4]] * 4, shares)
        gain, count = separate_gain(found, FREE, NEW, POLICY)
        lost += predicted_gain(found, FREE, NEW, POLICY) < 0
        differing += gain > chi2.isf(0.01, count)
    assert lost > 5
    assert differing < 5


def _choice(left, explained):
    """A choice whose named terms explain a part of the cost."""
    best = SimpleNamespace(fit=SimpleNamespace(cost=1000.0))
    before = SimpleNamespace(fit=SimpleNamespace(cost=1000.0 + explained))
    named = SimpleNamespace(
        best=best, left_after=left, left=[one for one in left if one.significant]
    )
    return SimpleNamespace(before=before, named=named)


def test_only_what_certainly_differs_and_matters_is_not_shared(unchecked_types):
    """A gain of 100 counts where the terms explain 4000 (2.25 % are 90) but not 5000,
    and not beside a common structure with a gain of 150."""
    own = Structure(
        "a", "a", "flight", "in flight", 100.0, 30.0, 3, predicted_gain=-5.0
    )
    sure = dataclasses.replace(own, differs=True)
    common = dataclasses.replace(own, gain=150.0, predicted_gain=80.0)
    assert not_shared(_choice([own], 0.0), POLICY) == []
    assert not_shared(_choice([sure], 0.0), POLICY) == [sure]
    assert not_shared(_choice([sure], 4000.0), POLICY) == [sure]
    assert not_shared(_choice([sure], 5000.0), POLICY) == []
    assert not_shared(_choice([sure, common], 0.0), POLICY) == []
