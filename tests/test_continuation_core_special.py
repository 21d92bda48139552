"""Cascades, curves in two parameters, resonances, boundary values, sensitivities."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from continuation_examples import a, b, CUSP, cusp_start, henon, LOGISTIC, mu
from scipy.optimize import brentq

import continuation
from continuation import BranchSettings


TWO = ((-5.0, 5.0), (-2.0, 2.0))


def test_cascade_of_the_logistic_map():
    cascade = continuation.cascade(LOGISTIC, [0.5], mu, (1.5, 4.0), flips=7)
    found = cascade.parameters
    assert all(point.converged for point in cascade.flips)
    assert found[:2] == pytest.approx([3.0, 1.0 + np.sqrt(6.0)], abs=1e-10)
    # the third is a root of a polynomial of degree 12 (Bailey, 1993)
    assert found[2] == pytest.approx(3.5440903595519, abs=1e-11)
    assert len(found) == 7
    assert cascade.ratios[-3:] == pytest.approx(4.669201609, rel=0.01)
    periods = [int(point.problem.period) for point in cascade.flips]
    assert periods == [1, 2, 4, 8, 16, 32, 64]
    assert all(point.criticality == "supercritical" for point in cascade.flips)


def test_special_points_without_second_derivatives():
    branch = continuation.branch(
        LOGISTIC, [0.5], mu, (1.5, 4.0), settings=BranchSettings(localise="bracket")
    )
    (flip,) = branch.special
    assert flip.converged and flip.parameter == pytest.approx(3.0, abs=1e-9)


@pytest.fixture(scope="module")
def cusp_branch():
    return continuation.branch(CUSP, cusp_start(-1.0), a, (-3.0, 3.0), direction=-1)


def test_fold_curve_through_its_cusp(cusp_branch):
    curve = continuation.curve(
        cusp_branch.of_kind("fold")[0], (a, b), ((-3.0, 3.0), (-2.0, 2.0))
    )
    first, second = np.array([point.parameters for point in curve.points]).T
    assert np.max(np.abs(27 * first**2 + 4 * second**3)) < 1e-9
    (cusp,) = curve.special
    assert cusp.kind == "cusp" and cusp.converged
    assert cusp.parameters == pytest.approx((0.0, 0.0), abs=1e-10)
    # both arms, up to the bound exactly
    ends = [curve.points[0], curve.points[-1]]
    assert [point.parameters[1] for point in ends] == [-2.0, -2.0]
    assert ends[0].parameters[0] == pytest.approx(-ends[1].parameters[0], abs=1e-9)


@pytest.mark.slow
def test_curves_of_the_henon_map():
    problem = continuation.FixedPoint(henon, {"a": 0.0, "b": 0.5})
    branch = continuation.branch(problem, [0.0, 0.0], a, (-1.0, 3.0), direction="both")
    (fold,), (flip,) = branch.of_kind("fold"), branch.of_kind("flip")
    # fixed points a = x^2 + (1 + b) x; fold at x = -(1+b)/2, flip at x = (1+b)/2
    assert fold.parameter == pytest.approx(-(1.5**2) / 4, abs=1e-10)
    assert flip.parameter == pytest.approx(3 * 1.5**2 / 4, abs=1e-10)
    curve = continuation.curve(flip, (a, b), TWO)
    for point in curve.points:
        first, second = point.parameters
        assert first == pytest.approx(3 * (1 + second) ** 2 / 4, abs=1e-9)
    named = {point.kind: point.parameters for point in curve.special}
    assert set(named) == {"fold-flip", "1:2 resonance"}
    assert named["fold-flip"] == pytest.approx((0.0, -1.0), abs=1e-8)
    assert named["1:2 resonance"] == pytest.approx((3.0, 1.0), abs=1e-10)
    curve = continuation.curve(fold, (a, b), TWO)
    named = {point.kind: point.parameters for point in curve.special}
    assert set(named) == {"fold-flip", "1:1 resonance"}
    assert named["1:1 resonance"] == pytest.approx((-1.0, 1.0), abs=1e-10)


def delayed_logistic(u, p):
    """x -> a x (1 - y), y -> x + b y^2: Neimark-Sacker at a = 2 for b = 0."""
    return jnp.stack([p["a"] * u[0] * (1.0 - u[1]), u[0] + p["b"] * u[1] ** 2])


@pytest.mark.slow
def test_neimark_sacker_and_its_curve():
    problem = continuation.FixedPoint(delayed_logistic, {"a": 1.5, "b": 0.0})
    branch = continuation.branch(problem, [1 / 3, 1 / 3], a, (1.2, 3.0))
    (point,) = branch.special
    assert point.kind == "Neimark-Sacker" and point.converged
    assert point.parameter == pytest.approx(2.0, abs=1e-10)
    # multipliers are exp(+-i pi/3), and the invariant curve is stable
    assert point.multipliers[0] ** 6 == pytest.approx(1.0, abs=1e-9)
    assert point.criticality == "supercritical"
    curve = continuation.curve(point, (a, b), ((0.5, 6.0), (-1.0, 1.0)))
    for point in curve.points:
        assert np.abs(point.multipliers) == pytest.approx([1.0, 1.0], abs=1e-9)
    (quarter,) = curve.special
    assert quarter.kind == "1:4 resonance"
    assert quarter.multipliers**4 == pytest.approx([1.0, 1.0], abs=1e-8)


def bogdanov_takens(u, p):
    """Normal form with folds at 4 a = b^2 and Hopf points at a = 0, b < 0."""
    x, y = u[0], u[1]
    return jnp.stack([y, p["a"] + p["b"] * x + x * x + x * y])


@pytest.mark.slow
def test_hopf_and_fold_curves_meet_at_a_bogdanov_takens_point():
    problem = continuation.Equilibrium(bogdanov_takens, {"a": -0.1, "b": -0.5})
    x = (0.5 - np.sqrt(0.25 + 0.4)) / 2
    branch = continuation.branch(problem, [x, 0.0], a, (-1.0, 1.0), direction="both")
    # where the eigenvalues are real and opposite (x = 0 on the saddle side) is no Hopf
    (hopf,), (fold,) = branch.of_kind("Hopf"), branch.of_kind("fold")
    assert len(branch.special) == 2
    assert hopf.parameter == pytest.approx(0.0, abs=1e-10)
    assert fold.parameter == pytest.approx(0.25**2, abs=1e-10)
    box = ((-1.0, 1.0), (-1.0, 1.0))
    hopfs, folds = (continuation.curve(p, (a, b), box) for p in (hopf, fold))
    for curve in (hopfs, folds):
        (meeting,) = curve.special
        assert meeting.kind == "Bogdanov-Takens" and meeting.converged
        assert meeting.parameters == pytest.approx((0.0, 0.0), abs=1e-9)
    # behind it the pair is real: neutral saddles are not followed
    assert max(point.parameters[1] for point in hopfs.points) < 1e-9
    assert min(point.parameters[1] for point in hopfs.points) == -1.0
    for point in folds.points:
        first, second = point.parameters
        assert 4 * first == pytest.approx(second**2, abs=1e-9)


def test_first_lyapunov_coefficient():
    # x' = -Y, Y' = x - x^2 + x Y at b = -1: r' = r^3 / 8 by Guckenheimer and Holmes,
    # (3.4.11), and 2 / omega times that in Kuznetsov's normalisation
    problem = continuation.Equilibrium(bogdanov_takens, {"a": -0.1, "b": -1.0})
    x = (1 - np.sqrt(1 + 0.4)) / 2
    branch = continuation.branch(problem, [x, 0.0], a, (-0.2, 0.1))
    (hopf,) = branch.of_kind("Hopf")
    assert hopf.coefficient == pytest.approx(0.25, abs=1e-9)
    assert hopf.criticality == "subcritical"


def _chebyshev(n):
    """Points in [0, 1] and the second derivative there (Trefethen, 2000, cheb)."""
    x = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.ones(n + 1)
    c[0] = c[-1] = 2.0
    c *= (-1.0) ** np.arange(n + 1)
    d = np.outer(c, 1 / c) / (x[:, None] - x[None, :] + np.eye(n + 1))
    d -= np.diag(d.sum(axis=1))
    return 4 * (d @ d)[1:-1, 1:-1]


def test_fold_of_a_boundary_value_problem():
    # Bratu: u'' + mu exp u = 0, u(0) = u(1) = 0
    second = jnp.asarray(_chebyshev(24))
    problem = continuation.Equations(
        lambda u, p: second @ u + p["mu"] * jnp.exp(u), {"mu": 0.0}
    )
    for point in continuation.follow(problem, np.zeros(23), mu, (0.0, 4.0)):
        if point.special:
            break
    theta = brentq(lambda t: t * np.tanh(t) - 1, 1.0, 2.0, xtol=1e-15)
    assert point.kind == "fold" and point.converged
    assert point.parameter == pytest.approx(8 * (theta / np.cosh(theta)) ** 2, abs=1e-9)
    assert point.state[11] == pytest.approx(2 * np.log(np.cosh(theta)), abs=1e-7)


def test_sensitivity_of_a_special_point(cusp_branch):
    fold = cusp_branch.of_kind("fold")[0]
    derivative = continuation.sensitivity(fold, a)
    # a = -2 (-b/3)^(3/2)
    assert derivative["b"] == pytest.approx(np.sqrt(1 / 3), abs=1e-10)
    assert derivative["a"] == 0

    def value(b):
        return continuation.special_point(fold, a, {"a": 2.0, "b": b})[1]

    h = 1e-4
    difference = (value(-1.0 + h) - value(-1.0 - h)) / (2 * h)
    assert difference == pytest.approx(derivative["b"], abs=1e-7)
    exact = jax.jvp(value, (jnp.asarray(-1.0),), (jnp.asarray(1.0),))[1]
    assert exact == pytest.approx(derivative["b"], abs=1e-10)
    assert value(-1.3) == pytest.approx(-2 * (1.3 / 3) ** 1.5, abs=1e-10)


def test_deflation_finds_all_roots():
    problem = continuation.Equilibrium(CUSP.vector_field, {"a": 0.0, "b": -1.0})
    found = continuation.deflate(problem, [[0.3]])
    assert sorted(u[0] for u in found) == pytest.approx([-1.0, 0.0, 1.0], abs=1e-10)
    more = continuation.deflate(problem, [[0.3]], known=[[0.0], [1.0]])
    assert np.array(more) == pytest.approx(np.array([[-1.0]]), abs=1e-10)


class Level(continuation.AbstractProblem):
    """u = mu, watched for mu = b^2."""

    parameters: dict
    stability = "none"

    def residual(self, u, parameters):
        return u - parameters["mu"]

    def seen(self, u, parameters):
        return {"level": u[0] - parameters["b"] ** 2}, {}

    def monitors(self):
        return {"level": continuation.Monitor("crossing")}


def test_zero_of_a_monitor_and_its_curve():
    branch = continuation.branch(
        Level({"mu": 0.0, "b": 0.5}), [0.0], mu, (-1.0, 1.0), direction="both"
    )
    (point,) = branch.special
    assert point.kind == "crossing" and point.converged
    assert point.parameter == pytest.approx(0.25, abs=1e-10)
    assert continuation.sensitivity(point, mu)["b"] == pytest.approx(1.0, abs=1e-10)
    curve = continuation.curve(point, (mu, b), ((-1.0, 0.81), (-2.0, 2.0)))
    first, second = np.array([point.parameters for point in curve.points]).T
    assert np.max(np.abs(first - second**2)) < 1e-10
    # bounds of the parameter that is an unknown hold too, exactly
    assert [point.parameters[0] for point in (curve.points[0], curve.points[-1])] == [
        0.81,
        0.81,
    ]
    assert "first parameter" in curve.reason


@pytest.mark.usefixtures("unchecked_types")
def test_curves_need_points_that_form_some(cusp_branch):
    with pytest.raises(ValueError, match="do not form a curve"):
        continuation.curve(cusp_branch.points[0], (a, b), TWO)
    fold = cusp_branch.of_kind("fold")[0]
    with pytest.raises(ValueError, match="two different"):
        continuation.curve(fold, (a, a), TWO)
    with pytest.raises(ValueError, match="two parameters"):
        continuation.curve(fold, a, TWO)
