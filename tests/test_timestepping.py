"""Time-stepping: complementarity problems, relays, and impacts without events."""

import itertools

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import simulate
from jaxcam.models import (
    BouncingBall,
    DesmodromicCam,
    FourierProfile,
    ImpactOscillator,
    preset,
)
from jaxcam.timestepping import moreau, relay_steps, RelaySystem
from jaxcam.timestepping.complementarity import lemke, solve_lcp
from jaxcam.timestepping.relay import is_p_matrix, relay_problem


_lemke = eqx.filter_jit(lemke)
_relay = eqx.filter_jit(relay_problem)


def by_enumeration(matrix, vector):
    """All solutions of a complementarity problem with 2^m choices of basis."""
    m = len(vector)
    found = []
    for chosen in itertools.product([False, True], repeat=m):
        rows = np.flatnonzero(chosen)
        z = np.zeros(m)
        if len(rows):
            part = matrix[np.ix_(rows, rows)]
            if abs(np.linalg.det(part)) < 1e-12:
                continue
            z[rows] = np.linalg.solve(part, -vector[rows])
        if np.all(z >= -1e-12) and np.all(matrix @ z + vector >= -1e-12):
            found.append(z)
    return found


def p_matrix(rng, m):
    """Any matrix with a positive definite symmetric part is a P-matrix."""
    half, turn = rng.normal(size=(2, m, m))
    return half @ half.T + 0.1 * np.eye(m) + turn - turn.T


def test_lemke_against_enumeration():
    """100 problems with P-matrices of 1 to 4 rows: the one solution, to 1e-9."""
    rng = np.random.default_rng(2)
    for k in range(100):
        m = 1 + k % 4
        matrix, vector = p_matrix(rng, m), rng.normal(size=m)
        assert is_p_matrix(matrix)
        (expected,) = by_enumeration(matrix, vector)
        found = _lemke(jnp.asarray(matrix), jnp.asarray(vector))
        assert int(found.code) == 0
        assert np.max(np.abs(found.z - expected)) < 1e-9


def test_lemke_does_not_cycle_where_ratios_tie():
    """A degenerate problem on which the plain least ratio cycles or stalls."""
    matrix = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 2.0], [2.0, 0.0, 1.0]])
    z = solve_lcp(matrix, -np.ones(3))
    assert np.max(np.abs(z - 1 / 3)) < 1e-12


@pytest.mark.usefixtures("unchecked_types")
def test_unsolvable_problem_is_refused():
    with pytest.raises(ValueError, match="no solution"):
        solve_lcp(-np.eye(1), -np.ones(1))
    with pytest.raises(ValueError, match="square"):
        solve_lcp(np.eye(2), np.ones(3))


def test_relay_problem_against_its_definition():
    """100 relay problems: u in [-1, 1], and u = -sign(y) where y is not zero."""
    rng = np.random.default_rng(3)
    for k in range(100):
        m = 1 + k % 3
        matrix, vector = p_matrix(rng, m), 2 * rng.normal(size=m)
        u, y, found = _relay(jnp.asarray(matrix), jnp.asarray(vector))
        assert int(found.code) == 0
        sliding = np.abs(y) < 1e-9
        assert np.max(np.abs(u)) <= 1.0
        assert np.max(np.where(sliding, 0.0, np.abs(u + np.sign(y)))) < 1e-9


def test_relay_that_slides():
    """x' = -sgn(x): reaches zero at x0, stays, and each step is exact up to h."""
    system = RelaySystem([[0.0]], [[1.0]], [[1.0]])
    for steps in (10, 100, 1000):
        motion = relay_steps(system, [0.75], 1.5, steps)
        exact = np.maximum(0.75 - np.asarray(motion.time), 0.0)
        assert np.max(np.abs(motion.state[:, 0] - exact)) < 1.5 / steps
        assert abs(motion.inputs[-1, 0]) < 1e-12


def test_relay_steps_are_of_first_order():
    """Damped oscillator with dry friction, x'' + x = -f sgn(x'), at t = 5.

    The motion is half turns about +f and -f, which is a closed form.
    """
    system = RelaySystem([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [0.5]], [[0.0, 1.0]])
    exact = _dry_friction(3.0, 0.5, 5.0)
    errors = []
    for steps in (1000, 2000, 4000, 8000):
        motion = relay_steps(system, [3.0, 0.0], 5.0, steps)
        errors.append(np.max(np.abs(motion.state[-1] - exact)))
    rates = np.log2(np.divide(errors[:-1], errors[1:]))
    assert np.max(np.abs(rates - 1)) < 0.05


def _dry_friction(x, friction, t):
    """Position and velocity of x'' + x = -friction sgn(x') from rest at x."""
    while t > np.pi:
        side = np.sign(x) * friction
        x, t = 2 * side - x, t - np.pi
    side = np.sign(x) * friction
    return np.array([side + (x - side) * np.cos(t), -(x - side) * np.sin(t)])


def test_relay_stays_where_friction_holds_it():
    """Dry friction: at rest for good where |x| <= f, with the input that holds it."""
    system = RelaySystem([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [0.5]], [[0.0, 1.0]])
    motion = relay_steps(system, [3.0, 0.0], 12.0, 4000)
    x, v = motion.state[-1]
    assert abs(v) < 1e-12 and abs(x) < 0.5
    assert abs(motion.inputs[-1, 0] - 2 * x) < 1e-9


ZENO = RelaySystem(np.zeros((2, 2)), [[1.0, -2.0], [2.0, 1.0]], np.eye(2))


def test_infinitely_many_switches():
    """x1' = -sgn x1 + 2 sgn x2, x2' = -2 sgn x1 - sgn x2 (Filippov's spiral).

    |x1| + |x2| falls at the rate 2, so it ends at (|x1| + |x2|)/2 after infinitely many
    switches. The error is h times the number of switches that steps can tell apart,
    which grows as log(1/h).
    """
    for steps in (200, 800, 3200):
        motion = relay_steps(ZENO, [1.0, 0.7], 2.0, steps)
        h = 2.0 / steps
        size = np.abs(np.asarray(motion.state)).sum(axis=1)
        exact = np.maximum(1.7 - 2 * np.asarray(motion.time), 0.0)
        assert np.max(np.abs(size - exact)) < 1.5 * h * np.log(1 / h)
        assert size[-1] < 1e-12


def test_relay_steps_with_two_solutions_are_refused():
    """x' = +sgn(x): at zero it may go either way."""
    with pytest.raises(ValueError, match="more than one solution"):
        relay_steps(RelaySystem([[0.0]], [[-1.0]], [[1.0]]), [0.0], 1.0, 10)
    with pytest.raises(ValueError, match="change the number"):
        relay_steps(RelaySystem([[10.0]], [[1.0]], [[1.0]]), [0.0], 1.0, 10)
    with pytest.raises(ValueError, match="shapes"):
        RelaySystem(np.eye(2), np.ones((2, 1)), np.ones((2, 2)))


# Moreau's steps of hybrid systems.


@pytest.mark.parametrize("r", [0.3, 0.8])
def test_zeno_ball_of_first_order(r):
    """Rest at 2 v0/(g (1 - r)), with order 1; mean of six runs a step size.

    The error of one run is a sawtooth of the position of the impacts in their steps.
    """
    ball = BouncingBall(gravity=9.81, restitution=r)
    end = 2.0 / (9.81 * (1 - r))
    sizes, errors = (512, 2048, 8192), []
    for size in sizes:
        runs = [
            moreau(ball, [0.0, 1.0], 0.0, 1.5 * end, size - 17 * k).rests_from()
            for k in range(6)
        ]
        errors.append(np.mean(np.abs(np.array(runs) - end)) / end)
    rate = np.log(errors[0] / errors[-1]) / np.log(sizes[-1] / sizes[0])
    assert abs(rate - 1) < 0.2
    assert errors[-1] < 20 / sizes[-1]


def test_ball_comes_to_rest_exactly():
    ball = BouncingBall(gravity=9.81, restitution=0.6)
    motion = moreau(ball, [0.0, 1.0], 0.0, 1.0, 2000)
    assert abs(motion.state[-1, 1]) < 1e-14
    assert abs(motion.state[-1, 0]) < 1e-4
    assert np.isnan(moreau(ball, [1.0, 1.0], 0.0, 0.1, 10).rests_from())


def against_events(system, start, t0, t1, sizes):
    """Mean error of the first component against the event-driven run, and its rate."""
    run = simulate(system, start, t0, t1)
    assert run.result == "" and int(run.impacts.count) >= 3
    errors = []
    for size in sizes:
        found = []
        # the error of one run depends on where in its steps the impacts fall
        for steps in size + 37 * np.arange(6):
            motion = moreau(system, start, t0, t1, int(steps))
            every = np.arange(1, 501) * (size // 500)
            exact = run.at(motion.time[every])[:, 0]
            found.append(np.mean(np.abs(motion.state[every, 0] - exact)))
        errors.append(np.mean(found))
    return np.log(errors[0] / errors[-1]) / np.log(sizes[-1] / sizes[0]), errors


@pytest.mark.slow
def test_impact_oscillator_by_steps():
    """Four impacts: first order against the event-driven run."""
    system = ImpactOscillator(omega=2.8, restitution=0.8, wall=0.0)
    start = jnp.array([-0.2, 0.3])
    rate, errors = against_events(system, start, 0.0, 9.0, (1000, 16000))
    assert abs(rate - 1) < 0.25
    assert errors[-1] < 2e-3


@pytest.mark.slow
def test_cam_follower_by_steps():
    """Impacts, complete chatter and contact on the cam: first order (rad, rad/s)."""
    system = preset("calibrated")
    period = float(system.period)
    t0 = 0.3 * period
    start = simulate(system, None, 0.0, t0).final
    rate, errors = against_events(system, start, t0, t0 + 1.5 * period, (1000, 16000))
    assert abs(rate - 1) < 0.3
    assert errors[-1] < 2e-3


def test_two_constraints_by_steps():
    """Between two flanks: gaps are violated by no more than a few steps allow."""
    system = DesmodromicCam(
        profile=FourierProfile(0.005, [-0.005], [0.0]), speed=10.0, clearance=1e-3
    )
    motion = moreau(system, [5e-4, 0.0], 0.0, 1.0, 4000)
    assert np.min(motion.gap) > -2e-4
    assert np.all(np.sum(np.asarray(motion.percussion) > 0, axis=0) > 0)


def test_wrong_input_is_refused():
    ball = BouncingBall()
    with pytest.raises(ValueError, match="after `t0`"):
        moreau(ball, [1.0, 0.0], 0.0, 0.0, 10)
    with pytest.raises(ValueError, match="principal minors"):
        is_p_matrix(np.eye(15))
