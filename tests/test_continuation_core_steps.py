"""Step control: what steps are taken, and that branches and batches agree on it."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import continuation
from continuation import BranchSettings, Natural, PseudoArclength
from continuation.predictors import Secant, TangentPredictor
from continuation.step_control import (
    AbstractStepControl,
    EffortAndAngle,
    Refusal,
    StepMeasures,
)


def mu(parameters):
    return parameters["mu"]


def parabola(u, parameters):
    return parameters["mu"] - u * u


def leap(u, parameters):
    """Two lines, and nothing between them: u = 0 and, from mu = 0.5 on, u = 10."""
    return u - jnp.where(parameters["mu"] < 0.5, 0.0, 10.0)


class Short(AbstractStepControl):
    """Steps of one length, whatever happened."""

    kept: ClassVar[float] = 0.03

    def refusals(self, measures: StepMeasures, step: Any, settings: BranchSettings):
        return {Refusal.TURNED: measures.angle > settings.max_angle}

    def next_step(self, measures: StepMeasures, step: Any, settings: BranchSettings):
        return 0 * step + self.kept


def test_length_follows_effort_and_angle():
    """Twice the step at most, half at least; by sqrt 2 for each iteration."""
    control, settings = EffortAndAngle(), BranchSettings(max_step=1.0)

    def factor(iterations, angle):
        measures = StepMeasures(
            np.float64(iterations), np.float64(0.0), np.float64(angle)
        )
        return control.next_step(measures, 0.01, settings) / 0.01

    aimed = settings.iterations
    assert factor(aimed, settings.angle) == pytest.approx(1.0)
    assert factor(aimed - 1, 1e-9) == pytest.approx(2**0.5)
    assert factor(aimed, 1.25 * settings.angle) == pytest.approx(0.8)
    assert factor(0, 1e-9) == 2.0
    assert factor(settings.max_iterations + 4, 1.0) == 0.5


def test_a_correction_longer_than_the_step_is_refused():
    """The branch ends at the discontinuity instead of leaping over it."""
    branch = continuation.branch(
        continuation.Equations(leap, {"mu": 0.0}), [0.0], mu, (-1.0, 1.0)
    )
    assert np.max(np.abs(branch.states)) == 0.0
    assert branch.parameters.max() == pytest.approx(0.5, abs=1e-6)
    assert Refusal.FARTHER in branch.reason


@pytest.mark.parametrize(
    "algorithm",
    [
        PseudoArclength(),
        PseudoArclength(control=Short()),
        Natural(predictor=TangentPredictor(), component="fastest"),
    ],
    ids=["arclength", "own control", "fastest component"],
)
def test_batch_takes_the_steps_of_a_branch(algorithm):
    """The same points to 1e-9 for the same algorithm, around a fold."""
    problem = continuation.Equilibrium(parabola, {"mu": 1.0})
    bounds, settings = (-1.0, 2.0), BranchSettings(special=False, max_points=60)
    branch = continuation.branch(
        problem, [-1.0], mu, bounds, algorithm, settings=settings, direction=-1
    )
    batch = continuation.follow_batch(
        problem, [[-1.0], [1.0]], mu, bounds, algorithm,
        settings=settings, direction=-1, points=60,
    )  # fmt: skip
    n = min(len(branch.regular), int(batch.count[0]))
    assert n > 30
    states, parameters = batch.states[0, :n], batch.parameters[0, :n]
    np.testing.assert_allclose(states, branch.states[:n], atol=1e-9)
    np.testing.assert_allclose(parameters, branch.parameters[:n], atol=1e-9)
    # both sides of the fold
    assert states.min() < -0.9 and states.max() > 0.1
    if isinstance(algorithm.control, Short):
        steps = np.array([point.step for point in branch.regular])[1:-1]
        assert steps == pytest.approx(Short.kept)


def test_settings_of_a_batch_share_a_program():
    """Tracing asks for the vector field; all settings but one do without it."""
    asked = []

    def counted(u, parameters):
        asked.append(u)
        return parabola(u, parameters)

    problem = continuation.Equilibrium(counted, {"mu": 1.0})

    def follow(**changes):
        before = len(asked)
        batch = continuation.follow_batch(
            problem, [[-1.0]], mu, (-1.0, 2.0),
            settings=BranchSettings(**changes), direction=-1, points=200,
        )  # fmt: skip
        return int(batch.count[0]), len(asked) > before

    plain, traced = follow()
    assert traced
    unused = {"max_points": 3, "special": False, "localise": "bracket"}
    assert follow(**unused) == (plain, False)
    # the program takes these as they come, and uses them
    for changes in (
        {"tolerance": 1e-6},
        {"iterations": 1},
        {"step": 1e-3},
        {"max_step": 1},
        {"angle": 1e-3},
    ):
        count, traced = follow(**changes)
        assert count != plain and not traced
    assert follow(max_iterations=9) == (plain, True)


def test_what_a_batch_cannot_follow_with_is_said():
    problem = continuation.Equilibrium(parabola, {"mu": 1.0})
    for algorithm, words in (
        (PseudoArclength(predictor=Secant()), "several points"),
        (continuation.MoorePenrose(), "not correct in a fixed plane"),
    ):
        with pytest.raises(ValueError, match=words):
            continuation.follow_batch(problem, [[-1.0]], mu, (-1.0, 2.0), algorithm)
