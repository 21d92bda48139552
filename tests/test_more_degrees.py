"""Several walls and several masses, by both engines, against what is known of them."""

import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import BallBetweenWalls, parameters, TwoMasses, TwoStops

import jaxcam


_ENGINES = ("loop", "diffeqsolve")
_CHAIN = dict(restitution=0.6, stiffness=1.0, damping=0.1)


def _never_through(trajectory):
    start = float(trajectory.steps.time[0])
    times = np.linspace(start, float(trajectory.t1), 4000)
    assert np.min(trajectory.gap(times)) > -1e-10
    states = np.asarray(trajectory.steps.state)
    assert np.all(np.isfinite(states))


@pytest.mark.parametrize("engine", _ENGINES)
def test_ball_between_walls_without_gravity(engine):
    """Each flight lasts width/speed, and each impact takes the same fraction."""
    r, width, speed = 0.8, 1.5, 3.0
    ball = BallBetweenWalls(**parameters(gravity=0.0, width=width, restitution=r))
    trajectory = jaxcam.simulate(ball, [0.0, speed], 0.0, 6.0, engine=engine)
    k = np.arange(trajectory.impacts.count)
    assert len(k) > 5
    # sum of width / (speed r^i)
    time = width / speed * (r ** -(k + 1.0) - 1) / (1 / r - 1)
    np.testing.assert_allclose(trajectory.impacts.time, time, rtol=1e-11)
    np.testing.assert_array_equal(trajectory.impacts.constraint, (k + 1) % 2)
    np.testing.assert_allclose(
        trajectory.impacts.speed_after, speed * r ** (k + 1.0), rtol=1e-11
    )
    _never_through(trajectory)


@pytest.mark.parametrize("engine", _ENGINES)
def test_ball_between_walls_under_gravity(engine):
    """Energy is kept in flight and falls by the law of restitution at each impact."""
    g, width, r = 9.81, 1.0, 0.9
    ball = BallBetweenWalls(**parameters(gravity=g, width=width, restitution=r))
    trajectory = jaxcam.simulate(ball, [0.3, 12.0], 0.0, 2.0, engine=engine)
    hits = trajectory.impacts
    before, after = np.asarray(hits.before), np.asarray(hits.after)
    assert hits.count > 8
    assert set(np.asarray(hits.constraint)) == {0, 1}

    def energy(states):
        return states[:, 1] ** 2 / 2 + g * states[:, 0]

    start = np.concatenate([[[0.3, 12.0]], after[:-1]])
    np.testing.assert_allclose(energy(before), energy(start), rtol=1e-9)
    np.testing.assert_allclose(after[:, 1], -r * before[:, 1], rtol=1e-12)
    wall = np.where(np.asarray(hits.constraint) == 0, 0.0, width)
    np.testing.assert_allclose(before[:, 0], wall, atol=1e-11)
    _never_through(trajectory)


@pytest.mark.parametrize("engine", _ENGINES)
def test_ball_comes_to_rest_on_the_lower_wall(engine):
    """The hops on the floor sum to a geometric series."""
    g, r, height = 9.81, 0.5, 0.4
    ball = BallBetweenWalls(**parameters(gravity=g, width=1.0, restitution=r))
    trajectory = jaxcam.simulate(ball, [height, 0.0], 0.0, 2.0, engine=engine)
    fall = np.sqrt(2 * height / g)
    assert trajectory.contacts.count == 1
    np.testing.assert_allclose(
        trajectory.contacts.start, [fall * (1 + r) / (1 - r)], rtol=1e-9
    )
    assert not bool(trajectory.contacts.released[0])
    np.testing.assert_allclose(trajectory.final, [0.0, 0.0], atol=1e-12)
    _never_through(trajectory)


def _chain(kind, **changes):
    values = dict(omega=0.6, stop=0.1, force=1.0, **_CHAIN)
    return kind(**parameters(**{**values, **changes}))


@pytest.mark.parametrize("engine", _ENGINES)
def test_two_masses(engine):
    """Mass 1 chatters, sticks while the second moves on, and is let go."""
    system = _chain(TwoMasses)
    state = [-0.5, 0.0, 0.0, 0.0]
    trajectory = jaxcam.simulate(system, state, 0.0, 25.0, engine=engine)
    assert trajectory.successful
    assert trajectory.impacts.count > 5
    assert bool(trajectory.contacts.released[0])
    _never_through(trajectory)
    start, end = (
        float(trajectory.contacts.start[0]),
        float(trajectory.contacts.end[0]),
    )
    inside = trajectory.at(jnp.linspace(start, end, 9)[:-1])
    np.testing.assert_allclose(inside[:, 0], 0.1, atol=1e-10)
    np.testing.assert_allclose(inside[:, 2], 0.0, atol=1e-10)
    # held, mass 1 would accelerate into the stop; at the release it no longer does
    pull = [
        float(system.vector_field(t, x)[2])
        for t, x in ((start, inside[0]), (end, trajectory.at([end])[0]))
    ]
    assert pull[0] > 1e-3
    assert abs(pull[1]) < 1e-9
    # the second mass swings as if the first were a fixed point
    t = np.linspace(start, end, 5)[1:-1]
    h = 1e-5
    x2, v2 = np.asarray(trajectory.at(t))[:, [1, 3]].T
    rate = np.asarray(trajectory.at(t + h) - trajectory.at(t - h))[:, 3] / (2 * h)
    expected = np.cos(0.6 * t) - (x2 - 0.1) - 0.1 * v2
    np.testing.assert_allclose(rate, expected, atol=1e-7)


def test_two_stops_held_at_once():
    """Both masses rest on their stops together, by both engines alike."""
    system = _chain(TwoStops, omega=0.3)
    state = [-0.5, -0.3, 0.0, 0.0]
    a, b = (
        jaxcam.simulate(system, state, 0.0, 25.0, tolerance=1e-12, engine=engine)
        for engine in _ENGINES
    )
    for trajectory in (a, b):
        assert trajectory.successful
        _never_through(trajectory)
        both = np.all(np.asarray(trajectory.steps.contact), axis=1)
        assert np.any(both)
        states = np.asarray(trajectory.steps.state)[np.flatnonzero(both)[1:-1]]
        np.testing.assert_allclose(states[:, :2], 0.1, atol=1e-9)
    assert a.contacts.count == b.contacts.count
    np.testing.assert_array_equal(a.contacts.constraint, b.contacts.constraint)
    np.testing.assert_allclose(a.contacts.start, b.contacts.start, atol=1e-8)
    np.testing.assert_allclose(a.contacts.end, b.contacts.end, atol=1e-8)
    np.testing.assert_allclose(a.final, b.final, atol=1e-8)
