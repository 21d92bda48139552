"""Branches that come back: closed curves, loops of doubled orbits, near misses.

Truth: the curves are given in closed form.
"""

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest

import continuation
from continuation import BranchSettings, Equations, FixedPoint, Monitor, Start
from tests.continuation_examples import circle, mu
from variational.orbits import multipliers_at_grazing


BOUNDS = (-2.0, 2.0)


def angle_turned(x, y):
    """Angle (rad) that the point (x, y) turns."""
    angle = np.unwrap(np.arctan2(y, x))
    return abs(angle[-1] - angle[0])


@pytest.mark.parametrize("start", [0.0, 0.3, -0.999])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_circle_is_gone_round_once_from_any_start(start, direction):
    problem = Equations(circle, {"mu": start})
    branch = continuation.branch(
        problem, [np.sqrt(1 - start**2)], mu, BOUNDS, direction=direction
    )
    assert branch.reason == "the branch is closed: back at its start"
    turned = angle_turned(branch.parameters, branch.states[:, 0])
    assert turned == pytest.approx(2 * np.pi, abs=1e-8)
    folds = sorted(point.parameter for point in branch.of_kind("fold"))
    assert folds == pytest.approx([-1.0, 1.0], abs=1e-10)


def eight(u, p):
    """u = sin s cos s, mu = sin s: crosses itself at the origin."""
    return u * u - p["mu"] ** 2 + p["mu"] ** 4


def test_a_figure_eight_is_closed_after_both_loops():
    """Crossing itself is no return: the phase s grows by a whole turn."""
    s = 0.4
    problem = Equations(eight, {"mu": float(np.sin(s))})
    branch = continuation.branch(problem, [np.sin(s) * np.cos(s)], mu, BOUNDS)
    assert branch.reason == "the branch is closed: back at its start"
    points = [p for p in branch.regular if abs(p.parameter) > 1e-3]
    sine = np.array([p.parameter for p in points])
    cosine = np.array([p.state[0] for p in points]) / sine
    turned = angle_turned(cosine, sine)
    assert turned == pytest.approx(2 * np.pi, abs=1e-8)
    crossings = branch.of_kind("branch point")
    assert len(crossings) == 2
    for crossing in crossings:
        assert crossing.converged
        assert abs(crossing.parameter) < 1e-8 and abs(crossing.state[0]) < 1e-8
        for half in continuation.switch(crossing, mu, BOUNDS):
            assert half.reason == "the branch is closed: back at its start"


def test_a_spiral_that_passes_near_itself_goes_on():
    """r = 1 + pitch angle / 2 pi: a turn later the branch is a pitch away, which is
    less than a step."""
    pitch, step = 1e-2, 0.015

    def spiral(u, p):
        r = jnp.hypot(u, p["mu"])
        angle = jnp.arctan2(p["mu"], u)
        return jnp.sin(jnp.pi * (r - 1.0) / pitch - angle / 2) * pitch

    settings = BranchSettings(step=step, max_step=step, max_points=700)
    problem = Equations(spiral, {"mu": 0.0})
    branch = continuation.branch(problem, [1.0], mu, (-1.2, 1.2), settings=settings)
    x, y = branch.states[:, 0], branch.parameters
    turned = angle_turned(x, y)
    assert "closed" not in branch.reason and turned > 3 * np.pi
    r = np.hypot(x, y)
    expected = 1 + pitch * np.unwrap(np.arctan2(y, x)) / (2 * np.pi)
    assert np.max(np.abs(r - expected)) < 1e-9


class Chart(continuation.AbstractProblem):
    """Half of the circle u^2 + mu^2 = 1, told by one unknown above and two below."""

    parameters: Any
    above: bool = eqx.field(static=True)
    stability: ClassVar = "none"

    def residual(self, u, parameters):
        first = u[:1] ** 2 + parameters["mu"] ** 2 - 1.0
        return first if self.above else jnp.append(first, u[1] - 2 * u[0])

    def seen(self, u, parameters):
        del parameters
        return {"edge": u[0] if self.above else -u[0]}, {}

    def monitors(self):
        return {"edge": Monitor("edge", ends=True)}

    def transition(self, point, at):
        other = Chart(point.problem.parameters, not self.above)
        state = np.zeros(2 if self.above else 1)
        sign = 1.0 if other.above else -1.0
        tangent = np.append(sign * np.array([1.0, 2.0])[: state.size], 0.0)
        return Start(other, state, float(point.parameter), tangent)

    @property
    def signature(self):
        return "above" if self.above else "below"

    def with_signature(self, signature):
        return Chart(self.parameters, signature == "above")


def test_a_branch_is_closed_although_its_problem_changed_on_the_way(tmp_path):
    """A start that other unknowns followed is still known, also by a resumed run."""
    problem = Chart({"mu": 0.2}, True)
    state = [np.sqrt(1 - 0.2**2)]
    settings = BranchSettings(max_points=300)
    path = tmp_path / "round.jsonl"
    branch = continuation.branch(
        problem, state, mu, BOUNDS, settings=settings, out=path
    )
    assert branch.reason == "the branch is closed: back at its start"
    assert len(branch.of_kind("edge")) == 2
    first, last = branch.points[0], branch.points[-1]
    assert last.parameter == first.parameter and last.state == first.state
    lengths = [point.arclength for point in branch.points]
    assert all(a <= b for a, b in zip(lengths[:-1], lengths[1:], strict=True))
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[: 2 * len(lines) // 3]))
    again = continuation.branch(
        problem, state, mu, BOUNDS, settings=settings, out=path, resume=True
    )
    assert again.reason == branch.reason and len(again.points) == len(branch.points)
    assert np.array_equal(again.parameters, branch.parameters)


def bubble(u, p):
    """Orbits of period two, u^2 = 1/4 - mu^2, between two flips of u = 0."""
    return -(1.25 - p["mu"] ** 2) * u + u**3


def test_doubled_orbits_end_where_they_join_their_parent_again():
    trunk = continuation.branch(
        FixedPoint(bubble, {"mu": -1.0}), [0.0], mu, (-1.0, 1.0)
    )
    left, right = trunk.of_kind("flip")
    for flip, other in ((left, right), (right, left)):
        (doubled,) = continuation.switch(flip, mu, (-1.0, 1.0))
        assert doubled.reason.startswith("the branch rejoins the orbits of half the")
        last = doubled.points[-1]
        assert last.parameter == pytest.approx(other.parameter, abs=1e-9)
        assert abs(last.state[0]) < 1e-9
        amplitude = doubled.states[:, 0] ** 2
        assert np.max(np.abs(amplitude - (0.25 - doubled.parameters**2))) < 1e-9
        # once over, and not back
        way = np.diff(doubled.parameters) * np.sign(other.parameter)
        assert np.all(way >= 0)


def test_orbits_run_through_twice_are_no_doubled_ones():
    """The parent as a solution of the doubled equations passes its flips."""
    trunk = FixedPoint(bubble, {"mu": -1.0}, period=2)
    branch = continuation.branch(trunk, [0.0], mu, (-1.0, 1.0))
    assert branch.reason == "mu is at its bound 1"
    found = [point.parameter for point in branch.of_kind("branch point")]
    assert found == pytest.approx([-0.5, 0.5], abs=1e-9)


def half_turned(u, p):
    """Orbits {z, -z} with z = (cos s/2, sin s/2) at mu = cos s."""
    size = jnp.sum(u * u) - 1.0
    double = u[0] ** 2 - u[1] ** 2 - p["mu"]
    return -u + 0.1 * (size * u + double * jnp.stack([-u[1], u[0]]))


def test_orbits_are_back_when_another_of_their_points_is():
    """Once round the circle of orbits a point has become the other one of its orbit."""
    s = 1.0
    problem = FixedPoint(half_turned, {"mu": float(np.cos(s))}, period=2)
    start = np.array([np.cos(s / 2), np.sin(s / 2)])
    branch = continuation.branch(problem, start, mu, BOUNDS)
    assert branch.reason == "the branch is closed: back at its start"
    turned = angle_turned(branch.states[:, 0], branch.states[:, 1])
    assert turned == pytest.approx(np.pi, abs=1e-8)
    assert branch.points[-1].state == pytest.approx(-start, abs=1e-9)


def tilted(u, p):
    """A line and a circle that cross at mu = -1 and 1, at u = 0.3 mu."""
    v = u - 0.3 * p["mu"]
    return v * (v * v + p["mu"] ** 2 - 1.0)


@pytest.mark.parametrize("localise", ["newton", "bracket"])
def test_pitchforks_are_located_with_and_without_second_derivatives(localise):
    settings = BranchSettings(localise=localise)
    trunk = continuation.branch(
        continuation.Equilibrium(tilted, {"mu": -1.7}), [-0.51], mu, BOUNDS,
        settings=settings,
    )  # fmt: skip
    forks = trunk.of_kind("branch point")
    assert [fork.converged for fork in forks] == [True, True]
    for fork, sign in zip(forks, (-1.0, 1.0), strict=True):
        assert fork.parameter == pytest.approx(sign, abs=1e-9)
        assert fork.state[0] == pytest.approx(0.3 * sign, abs=1e-9)
        # at a pitchfork an eigenvalue is zero
        assert abs(fork.multipliers[0]) < 1e-8
    halves = continuation.switch(forks[0], mu, BOUNDS, settings=settings)
    for half in halves:
        assert half.reason == "the branch is closed: back at its start"
        assert all(p.converged for p in half.special)
        assert {p.kind for p in half.special} == {"branch point"}
    # both are the circle, begun on its two sides of the line
    beginnings = []
    for half in halves:
        v = half.states[:, 0] - 0.3 * half.parameters
        assert np.max(np.abs(v**2 + half.parameters**2 - 1)) < 1e-9
        beginnings.append(np.sign(v[0]))
    assert sorted(beginnings) == [-1.0, 1.0]


def test_a_pitchfork_that_is_none_says_so():
    """With a small imperfection the determinant jumps, and no branches cross."""
    problem = continuation.Equilibrium(
        lambda u, p: p["mu"] * u - u**3 + 1e-6, {"mu": -1.0}
    )
    branch = continuation.branch(problem, [-1e-6], mu, (-1.0, 1.0))
    assert branch.special
    for point in branch.special:
        assert not point.converged and "no solution there" in point.reason


@pytest.mark.parametrize("n", [2, 3])
def test_multipliers_at_a_grazing_are_limits(n):
    """Against the eigenvalues at a speed of 1e-30, with 60 digits."""
    rng = np.random.default_rng(n)
    regular = rng.normal(size=(n, n))
    left, right = rng.normal(size=n), rng.normal(size=n)
    found = multipliers_at_grazing(regular, np.outer(left, right))
    with mpmath.workdps(60):
        # of rank one to all digits
        singular = mpmath.matrix(left.tolist()) * mpmath.matrix(right.tolist()).T
        matrix = mpmath.matrix(regular.tolist()) + singular / mpmath.mpf("-1e-30")
        values = mpmath.eig(matrix, left=False, right=False)
        values = sorted(values, key=lambda value: -abs(value))
        growing = float(mpmath.sign(values[0].real))
        limits = np.array([complex(value) for value in values[1:]])
    assert found[0].real == growing * np.inf
    assert np.sort_complex(found[1:]) == pytest.approx(
        np.sort_complex(limits), rel=1e-10, abs=1e-10
    )


def test_multipliers_at_a_grazing_without_growth_are_not_known():
    singular = np.outer([1.0, 0.0], [0.0, 1.0])
    assert np.all(np.isnan(multipliers_at_grazing(np.eye(2), singular)))
