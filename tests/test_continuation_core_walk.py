"""How a branch is walked: algorithms, predictors, bounds, returns, reasons."""

import jax.numpy as jnp
import numpy as np
import pytest
from continuation_examples import a, circle, CUSP, cusp_start, LOGISTIC, logistic, mu

import continuation
from continuation import (
    BranchSettings,
    Equations,
    MoorePenrose,
    Natural,
    PolynomialPredictor,
    PseudoArclength,
)
from continuation.predictors import Extrapolation, Secant, TangentPredictor


# parameter values of the folds of x^3 - x + a
FOLD = 2 / np.sqrt(27)


@pytest.mark.parametrize(
    "algorithm",
    [
        PseudoArclength(),
        PseudoArclength(Secant()),
        PseudoArclength(PolynomialPredictor(2)),
        PseudoArclength(PolynomialPredictor(5)),
        PseudoArclength(Extrapolation()),
        MoorePenrose(),
        MoorePenrose(PolynomialPredictor()),
        Natural(TangentPredictor(), component="fastest"),
    ],
    ids=str,
)
def test_algorithms_agree_through_folds(algorithm):
    branch = continuation.branch(
        CUSP, cusp_start(-1.0), a, (-3.0, 3.0), algorithm, direction=-1
    )
    x = branch.states[:, 0]
    assert np.max(np.abs(branch.parameters - x + x**3)) < 1e-9
    assert np.all(np.diff(x) > 0)
    found = [point.parameter for point in branch.of_kind("fold")]
    assert found == pytest.approx([-FOLD, FOLD], abs=1e-10)
    assert all(point.converged for point in branch.special)
    assert branch.points[-1].parameter == -3.0


def test_natural_continuation_stops_at_a_fold_and_says_why():
    branch = continuation.branch(
        CUSP, cusp_start(-1.0), a, (-3.0, 3.0), Natural(), direction=-1
    )
    # exactly up to the first fold, in the direction of smaller a
    end = branch.points[-1]
    assert end.kind == "end" and "halved" in end.reason
    assert -FOLD <= end.parameter < -FOLD + 1e-3


def test_higher_order_takes_fewer_iterations():
    def effort(predictor):
        branch = continuation.branch(
            CUSP,
            cusp_start(-1.0),
            a,
            (-3.0, 3.0),
            PseudoArclength(predictor),
            settings=BranchSettings(special=False, max_step=0.01),
            direction=-1,
        )
        return np.mean([point.iterations for point in branch.points])

    assert effort(PolynomialPredictor(4)) < effort(TangentPredictor())


def test_back_and_forth():
    there = continuation.branch(CUSP, cusp_start(-1.0), a, (-3.0, 3.0), direction=-1)
    last = there.points[-1]
    back = continuation.branch(last.problem, last.state, a, (-3.0, 2.0), direction=1)
    assert back.points[-1].state == pytest.approx(there.points[0].state, abs=1e-9)
    found = [point.parameter for point in back.of_kind("fold")]
    assert found == pytest.approx([FOLD, -FOLD], abs=1e-10)


def test_both_directions_make_one_branch():
    middle = continuation.Equilibrium(CUSP.vector_field, {"a": 0.0, "b": -1.0})
    branch = continuation.branch(middle, [0.0], a, (-3.0, 3.0), direction="both")
    assert [point.label for point in branch.points] == list(
        range(1, len(branch.points) + 1)
    )
    assert {branch.points[0].parameter, branch.points[-1].parameter} == {-3.0, 3.0}
    x = branch.states[:, 0]
    assert np.all(np.diff(x) > 0) or np.all(np.diff(x) < 0)
    assert len(branch.of_kind("fold")) == 2


def test_closed_curve_ends_at_its_start():
    problem = Equations(circle, {"mu": 0.0})
    branch = continuation.branch(problem, [1.0], mu, (-2.0, 2.0))
    assert "closed" in branch.reason
    first, last = branch.points[0], branch.points[-1]
    assert last.parameter == first.parameter and last.state == first.state
    folds = sorted(point.parameter for point in branch.of_kind("fold"))
    assert folds == pytest.approx([-1.0, 1.0], abs=1e-10)
    # once around, not twice: the angle only grows
    angle = np.unwrap(np.arctan2(branch.parameters, branch.states[:, 0]))
    assert abs(angle[-1] - angle[0]) == pytest.approx(2 * np.pi, abs=1e-6)


def test_the_bound_is_hit_exactly_and_never_passed():
    high = 3.7123456789
    points = list(continuation.follow(LOGISTIC, [0.5], mu, (1.0, high)))
    assert points[-1].parameter == high
    assert points[-1].kind == "end" and "bound" in points[-1].reason
    assert max(point.parameter for point in points) == high
    # a start on the bound that leads out of it has nowhere to go
    again = points[-1]
    only = continuation.branch(again.problem, again.state, mu, (1.0, high))
    assert [point.kind for point in only.points] == ["start", "end"]


def test_follow_is_lazy_and_stops_when_the_reader_does():
    seen = []
    for point in continuation.follow(LOGISTIC, [0.5], mu, (1.0, 4.0)):
        seen.append(point.label)
        if point.kind == "flip":
            break
    assert point.parameter == pytest.approx(3.0, abs=1e-10)
    assert seen == list(range(1, len(seen) + 1))


def test_a_callback_can_end_a_branch():
    branch = continuation.branch(
        LOGISTIC, [0.5], mu, (1.0, 4.0), callbacks=[lambda p: p.parameter > 2.5]
    )
    assert branch.points[-2].parameter <= 2.5 < branch.points[-1].parameter


class Shelf(continuation.AbstractProblem):
    """u = mu, which exists for u < 1 only: its monitor is a square root there."""

    parameters: dict
    lower: bool = True
    stability = "none"

    def residual(self, u, parameters):
        if self.lower:
            return jnp.where(u < 1.0, u - parameters["mu"], jnp.nan)
        return u - 2.0 * parameters["mu"] + 1.0

    def seen(self, u, parameters):
        if not self.lower:
            return {}, {}
        return {"room": jnp.where(u[0] <= 1.0, 1.0 - u[0], jnp.nan)}, {}

    def monitors(self):
        edge = continuation.Monitor("edge", ends=True)
        return {"room": edge} if self.lower else {}

    def transition(self, point, at):
        return continuation.Start(
            Shelf(point.problem.parameters, False), point.state, point.parameter
        )

    @property
    def signature(self):
        return "lower" if self.lower else "upper"


def test_a_branch_goes_on_with_another_problem_behind_the_zero_of_a_monitor():
    branch = continuation.branch(Shelf({"mu": 0.0}), [0.0], mu, (-1.0, 3.0))
    (edge,) = branch.special
    assert edge.kind == "edge" and edge.converged
    # nothing exists behind it, so it is approached from one side
    assert edge.parameter == pytest.approx(1.0, abs=1e-10)
    before = [p for p in branch.regular if p.signature == "lower"]
    behind = [p for p in branch.regular if p.signature == "upper"]
    assert max(p.parameter for p in before) < 1.0
    assert [p.state[0] for p in behind] == pytest.approx(
        [2 * p.parameter - 1 for p in behind]
    )
    assert branch.points[-1].parameter == 3.0
    assert np.all(np.diff(branch.parameters) >= 0)


class Fenced(continuation.AbstractProblem):
    """u = mu, admissible up to u = 1."""

    parameters: dict
    stability = "none"

    def residual(self, u, parameters):
        return u - parameters["mu"]

    def check(self, point):
        return "u is beyond the fence" if point.state[0] > 1.0 else None


def test_an_inadmissible_point_is_reported_and_not_returned():
    branch = continuation.branch(Fenced({"mu": 0.0}), [0.0], mu, (-1.0, 3.0))
    assert "u is beyond the fence" in branch.reason
    assert branch.states.max() <= 1.0
    # as near as the smallest step allows
    assert branch.points[-1].parameter == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(ValueError, match="fence"):
        continuation.follow(Fenced({"mu": 2.0}), [2.0], mu, (-1.0, 3.0))


@pytest.mark.parametrize(
    ("start", "where", "bounds", "words"),
    [
        ([0.5], lambda p: p["speed"], (1.0, 4.0), "does not exist"),
        ([0.5], lambda p: p, (1.0, 4.0), "parameters as they are"),
        ([0.5], mu, (4.0, 1.0), "are reversed"),
        ([0.5], mu, (1.0, np.inf), "finite"),
        ([0.5], mu, 4.0, "two numbers"),
        ([0.5], mu, (2.5, 4.0), "outside the bounds"),
        ([np.nan], mu, (1.0, 4.0), "finite numbers"),
    ],
)
@pytest.mark.usefixtures("unchecked_types")
def test_bad_input(start, where, bounds, words):
    with pytest.raises(ValueError, match=words):
        continuation.follow(LOGISTIC, start, where, bounds)


def test_a_start_without_a_solution():
    problem = continuation.Equilibrium(
        lambda u, p: u * u + 1.0 + p["mu"] ** 2, {"mu": 0.0}
    )
    with pytest.raises(ValueError, match="not a solution"):
        continuation.follow(problem, [5.0], mu, (-1.0, 1.0))


def test_bad_settings():
    for wrong in (
        {"tolerance": -1.0},
        {"step": 1.0},
        {"max_angle": 0.01},
        {"iterations": 20},
        {"localise": "guess"},
        {"max_points": 0},
    ):
        with pytest.raises(ValueError):
            BranchSettings(**wrong)
    with pytest.raises(ValueError, match="period"):
        continuation.FixedPoint(logistic, {"mu": 2.0}, period=0)


@pytest.mark.parametrize("step", [0.02, 0.5])
def test_a_fold_just_behind_the_start_is_not_stepped_over(step):
    """p = u - 10 u^2 from u = 0 along its tangent: the fold is at u = 0.05."""
    problem = continuation.Equilibrium(lambda u, p: p["a"] - u + 10 * u**2, {"a": 0.0})
    start = continuation.Start(
        problem, np.zeros(1), 0.0, np.array([1.0, 1.0]), step=step
    )
    found = continuation.branch(problem, start, "a", (-1.0, 1.0))
    (fold,) = found.of_kind("fold")
    assert fold.parameter == pytest.approx(0.025, abs=1e-9)
    assert fold.state[0] == pytest.approx(0.05, abs=1e-6)
