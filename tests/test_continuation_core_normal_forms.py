"""The normal forms (2.16) ff.: detected, classified, and their branches switched to."""

import numpy as np
import pytest
from continuation_examples import (
    flip_map,
    fold_field,
    hopf_field,
    mu,
    pitchfork_field,
    transcritical_field,
)

import continuation
from continuation.special._differences import along


BOUNDS = (-1.5, 1.5)


def test_fold():
    problem = continuation.Equilibrium(fold_field, {"mu": 1.0})
    branch = continuation.branch(problem, [1.0], mu, (-1.0, 1.5), direction=-1)
    (fold,) = branch.special
    assert fold.kind == "fold" and fold.converged
    assert abs(fold.parameter) < 1e-10 and abs(fold.state[0]) < 1e-10
    # x' = -x^2 at the fold
    assert fold.coefficient == pytest.approx(-1.0, abs=1e-9)
    assert "larger" in fold.criticality
    # the second half is unstable, and both lie on mu = x^2
    assert branch.points[0].stable and not branch.points[-1].stable
    assert np.max(np.abs(branch.states[:, 0] ** 2 - branch.parameters)) < 1e-9
    assert branch.points[-1].parameter == 1.5
    for point in branch.regular:
        assert point.stable == (point.state[0] > 0)
        assert point.multipliers[0].real == pytest.approx(-2 * point.state[0], abs=1e-9)


@pytest.mark.parametrize(
    ("field", "solution"),
    [
        (transcritical_field, lambda m, x: x - m),
        (pitchfork_field, lambda m, x: x * x - m),
    ],
)
def test_crossing_branches_are_switched(field, solution):
    problem = continuation.Equilibrium(field, {"mu": -1.0})
    trivial = continuation.branch(problem, [0.0], mu, BOUNDS)
    (crossing,) = trivial.special
    assert crossing.kind == "branch point" and crossing.converged
    assert abs(crossing.parameter) < 1e-10
    assert all(p.stable == (p.parameter < 0) for p in trivial.regular)
    halves = continuation.switch(crossing, mu, BOUNDS)
    assert len(halves) == 2
    for half in halves:
        miss = [solution(p.parameter, p.state[0]) for p in half.points]
        assert np.max(np.abs(miss)) < 1e-9
        assert min(abs(p.state[0]) for p in half.points) > 1e-3
        assert abs(half.points[-1].parameter) == 1.5
        # exchange of stability
        assert all(p.stable == (p.parameter > 0) for p in half.points)
    signs = {np.sign(half.points[-1].state[0]) for half in halves}
    assert signs == {-1.0, 1.0}


def test_pitchfork_is_a_branch_point_from_its_other_branch_too():
    problem = continuation.Equilibrium(pitchfork_field, {"mu": 1.0})
    branch = continuation.branch(problem, [1.0], mu, BOUNDS, direction=-1)
    assert [point.kind for point in branch.special] == ["branch point"]
    assert branch.points[-1].state[0] == pytest.approx(-np.sqrt(1.5), abs=1e-10)


def test_hopf_and_its_limit_cycle():
    problem = continuation.Equilibrium(hopf_field, {"mu": -1.0})
    trivial = continuation.branch(problem, [0.0, 0.0], mu, BOUNDS)
    (hopf,) = trivial.special
    assert hopf.kind == "Hopf" and hopf.converged
    assert abs(hopf.parameter) < 1e-10
    # r' = -r^3 and omega = 2, in Kuznetsov's normalisation
    assert hopf.coefficient == pytest.approx(-1.0, abs=1e-9)
    assert hopf.criticality == "supercritical"
    (cycles,) = continuation.switch(hopf, mu, BOUNDS)
    assert not cycles.special
    for point in cycles.points:
        m = point.parameter
        # radius^2 = mu, period 2 pi / 2, multiplier exp(-2 mu T)
        assert np.sum(point.state[:2] ** 2) == pytest.approx(m, abs=1e-9)
        assert point.state[2] == pytest.approx(np.pi, abs=1e-9)
        assert point.multipliers == pytest.approx([np.exp(-2 * np.pi * m)], abs=1e-9)
        assert point.observed["error"] < 1e-9
    assert cycles.points[-1].parameter == 1.5


def test_flip_and_its_doubled_orbit():
    problem = continuation.FixedPoint(flip_map, {"mu": -0.5})
    trivial = continuation.branch(problem, [0.0], mu, (-0.8, 0.5))
    (flip,) = trivial.special
    assert flip.kind == "flip" and flip.converged
    assert abs(flip.parameter) < 1e-10
    assert flip.coefficient == pytest.approx(1.0, abs=1e-9)
    assert flip.criticality == "supercritical"
    (doubled,) = continuation.switch(flip, mu, (-0.8, 0.5))
    for point in doubled.points:
        # x -> -x needs (1 + mu) x - x^3 = x
        assert point.state[0] ** 2 == pytest.approx(point.parameter, abs=1e-9)
        assert point.stable
        assert int(point.problem.period) == 2
    assert doubled.points[-1].parameter == 0.5


def test_no_branch_leaves_a_fold():
    problem = continuation.Equilibrium(fold_field, {"mu": 1.0})
    branch = continuation.branch(problem, [1.0], mu, (-1.0, 1.5), direction=-1)
    with pytest.raises(ValueError, match="branches emanate from branch points"):
        continuation.switch(branch.special[0], mu, BOUNDS)


def test_differences_along_a_line_are_right_to_many_digits():
    def matrices(moves):
        x, y = 0.3 + moves[:, 0], -0.7 + moves[:, 1]
        rows = [[np.sin(3 * x), np.exp(x * y)], [x * y, 1 / (2 + x + y)]]
        return np.moveaxis(np.array(rows), -1, 0)

    direction = np.array([1.0, 0.5]) / 128
    first, second = along(matrices, direction)
    x, y, a, b = 0.3, -0.7, *direction
    e, s, d = np.exp(x * y), a + b, 2 + x + y
    t = a * y + x * b
    want = [[3 * a * np.cos(3 * x), e * t], [t, -s / d**2]]
    again = [
        [-9 * a * a * np.sin(3 * x), e * (t * t + 2 * a * b)],
        [2 * a * b, 2 * s * s / d**3],
    ]
    assert np.max(np.abs(first - want)) < 1e-11 * np.max(np.abs(want))
    assert np.max(np.abs(second - again)) < 1e-8 * np.max(np.abs(again))
    # without a derivative there is no number
    rough = along(lambda moves: np.abs(moves[:, :1, None]) ** 0.5, direction)[1]
    assert np.all(np.isnan(rough))
