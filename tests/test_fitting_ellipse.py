"""Joint confidence regions: their geometry, and how often they hold the truth."""

import dataclasses
import math

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.stats
from fitting_rigs import DraggedBall
from numpy.testing import assert_allclose

from jaxcam import fitting
from jaxcam.fitting._ellipse import Ellipse, most_correlated
from jaxcam.recordings import record, segment


NOISE = 1e-3
TRUTH = {"gravity": 9.7, "drag": 0.12, "restitution": 0.75}
BALL = DraggedBall(**TRUTH)
SENSORS = {"height_m": fitting.Sensor(0, noise=NOISE)}
PARAMETERS = [
    fitting.Parameter(name, lambda m, name=name: getattr(m.system, name), scale=0.1)
    for name in TRUTH
]


def fitted(seed) -> fitting.Fit:
    run = record(
        BALL,
        SENSORS,
        1.2,
        rng=np.random.default_rng(seed),
        state=jnp.array([1.0, 0.0]),
        interval=2e-3,
    )
    part = segment(run, "height_m", np.zeros(len(run)), noise=NOISE, restitution=0.75)
    problem = fitting.Problem.build(fitting.Model(BALL, SENSORS), [part], PARAMETERS)
    return fitting.fit(problem)


@pytest.fixture(scope="module")
def found():
    return fitted(0)


def region(level, number=3) -> Ellipse:
    """Of parameters of very different size, two of them closely correlated."""
    size = np.diag([1e-3, 50.0, 2.0])
    correlation = np.array([[1, 0.99, 0.3], [0.99, 1, 0.3], [0.3, 0.3, 1]])
    covariance = size @ correlation @ size
    names = ("a", "b", "c")[:number]
    centre = np.array([1.0, 1e4, -3.0])[:number]
    return Ellipse(names, centre, covariance[:number, :number], level)


@pytest.mark.parametrize("number", [2, 3])
@pytest.mark.parametrize("level", [0.5, 0.95])
def test_share_of_gaussian_draws_inside(level, number):
    """The degrees of freedom are those of the parameters: one or all would fail."""
    ellipse = region(level, number)
    rng = np.random.default_rng(1)
    draws = rng.multivariate_normal(ellipse.centre, ellipse.covariance, 40_000)
    inside = np.mean(ellipse.contains(draws))
    assert abs(inside - level) < 4.5 * math.sqrt(level * (1 - level) / 40_000)
    inverse = np.linalg.inv(ellipse.covariance)
    off = draws[:50] - ellipse.centre
    assert_allclose(
        ellipse.chi_square(draws[:50]), np.sum(off @ inverse * off, axis=1), rtol=1e-9
    )


def test_axes_and_outline():
    ellipse = region(0.9)
    axes = ellipse.axes
    assert_allclose(ellipse.chi_square(ellipse.centre + axes), ellipse.limit)
    assert_allclose(axes.T @ axes / ellipse.limit, ellipse.covariance, rtol=1e-12)
    in_errors = axes / np.sqrt(np.diag(ellipse.covariance))
    lengths = np.linalg.norm(in_errors, axis=1)
    assert np.all(np.diff(lengths) < 0)
    assert_allclose(in_errors @ in_errors.T, np.diag(lengths**2), atol=1e-12)
    pair = region(0.9, 2)
    edge = pair.polygon(361)
    assert_allclose(pair.chi_square(edge), pair.limit, rtol=1e-9)
    # wider than the interval of one parameter, by the root of the chi-square
    reach = np.max(edge, axis=0) - pair.centre
    errors = np.sqrt(np.diag(pair.covariance))
    assert_allclose(reach, math.sqrt(-2 * math.log(0.1)) * errors, rtol=1e-4)
    with pytest.raises(ValueError, match="has no outline"):
        ellipse.polygon()


def test_ellipse_of_a_fit(found):
    names = ["restitution", "gravity"]
    ellipse = found.ellipse(names, 0.9)
    assert_allclose(ellipse.centre, [found[name].value for name in names])
    assert_allclose(
        np.sqrt(np.diag(ellipse.covariance)), [found[name].stderr for name in names]
    )
    with pytest.raises(KeyError, match="'mass' was not fitted"):
        found.ellipse(["mass", "gravity"])
    with pytest.raises(ValueError, match="two or more different"):
        found.ellipse(["gravity"])
    with pytest.raises(ValueError, match="between 0 and 1"):
        found.ellipse(names, 95)


def test_the_cost_at_the_edge_is_the_chi_square(found):
    """With one, two and all parameters held: the ball is nearly a linear model."""
    for names in (["gravity", "drag"], list(TRUTH)):
        ellipse = found.ellipse(names)
        for axis in ellipse.axes:
            edge = dict(zip(names, ellipse.centre + axis))
            cost = fitting.excess_cost(found, edge)
            assert cost == pytest.approx(ellipse.limit, rel=0.1)
    one = found["gravity"]
    away = one.value + one.stderr
    curve = fitting.profile(found, "gravity", values=[one.value, away])
    cost = fitting.excess_cost(found, {"gravity": away})
    assert cost == pytest.approx(curve.cost[-1], abs=2e-3)


def test_an_unconstrained_parameter_has_no_range_to_profile(found):
    blind = tuple(dataclasses.replace(one, stderr=math.inf) for one in found.estimates)
    blind = dataclasses.replace(found, estimates=blind)
    with pytest.raises(ValueError, match="inf, so .* give the `values`"):
        fitting.profile(blind, "gravity")


def test_the_worst_pair_is_said(found):
    sentence = found.most_correlated()
    worst = np.max(np.abs(np.tril(found.correlation, -1)))
    assert f"{worst:.4f}" in sentence
    assert sum(name in sentence for name in TRUTH) == 2


def test_no_parameter_is_hard_to_distinguish_from_itself():
    """Parameters without correlation, or with one that is not a number."""
    for value in (0.0, math.nan):
        correlation = np.where(np.eye(2) > 0, 1.0, value)
        sentence = most_correlated(("gravity", "drag"), correlation)
        assert sentence == "No two fitted parameters are correlated."


@pytest.mark.slow
def test_regions_hold_the_truth_as_often_as_they_say():
    """Distances of the truth follow a chi-square of 2 and of 3 degrees."""
    pairs, triples = [], []
    for seed in range(200):
        fit = fitted(seed)
        assert fit.converged
        for names, distances in ((["gravity", "drag"], pairs), (list(TRUTH), triples)):
            truth = [TRUTH[name] for name in names]
            distances.append(float(fit.ellipse(names).chi_square(np.array(truth))))
    for degrees, distances in ((2, pairs), (3, triples)):
        inside = np.mean(np.array(distances) < scipy.stats.chi2.ppf(0.95, degrees))
        # 95 +- 1.5 %
        assert 0.90 <= inside <= 0.99
        assert scipy.stats.kstest(distances, "chi2", args=(degrees,)).pvalue > 1e-3
