"""Friction that is proportional to a contact force: closed forms."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from textbook_systems import parameters

import jaxcam
from jaxcam.hybrid import flow, SwitchedSystem
from jaxcam.hybrid.surface import impacts
from jaxcam.models import InclinedShaker, SpinningBall


G = 9.81


def _plane(**numbers):
    given = dict(incline=0.0, friction_coefficient=0.3, amplitude=0.0, omega=3.0)
    return InclinedShaker(**parameters(**(given | numbers)))


def test_a_block_slides_down_a_steep_plane():
    """a = g (sin - mu cos), to 1e-12."""
    made = jaxcam.simulate(_plane(incline=0.5), [0.0, 0.0, 1.0, 0.0], 0.0, 1.0)
    assert made.successful, made.result
    a = G * (np.sin(0.5) - 0.3 * np.cos(0.5))
    np.testing.assert_allclose(made.final, [1 + a / 2, 0, 1 + a, 0], atol=1e-12)


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_a_block_stops_on_a_flat_plane_and_stays(speed):
    """At the time v / (mu g cos -+ g sin), to 1e-12."""
    plane = _plane(incline=0.2)
    made = jaxcam.simulate(plane, [0.0, 0.0, speed, 0.0], 0.0, 2.0)
    a = G * (0.3 * np.cos(0.2) - np.sign(speed) * np.sin(0.2))
    assert made.successful, made.result
    np.testing.assert_allclose(made.switches.time, [1 / a], atol=1e-12)
    np.testing.assert_allclose(made.final, [speed / (2 * a), 0, 0, 0], atol=1e-12)


@pytest.mark.parametrize("static", [1.0, 1.4])
def test_a_shaken_block_breaks_loose_at_the_cone_of_friction(static):
    """A w^2 sin(w t) = static mu g, to 1e-12."""
    omega, amplitude = 3.0, 0.9
    plane = _plane(omega=omega, amplitude=amplitude, direction=0.0, static=static)
    made = jaxcam.simulate(plane, np.zeros(4), 0.0, 0.5)
    assert made.successful, made.result
    time = np.arcsin(static * 0.3 * G / (amplitude * omega**2)) / omega
    # sticks from the start, then leaves
    np.testing.assert_allclose(made.switches.time, [time], atol=1e-12)
    swing = amplitude * omega * (np.cos(omega * time) - np.cos(0.5 * omega))
    speed = swing - 0.3 * G * (0.5 - time)
    np.testing.assert_allclose(made.final[2], speed, atol=1e-11)


def test_friction_follows_the_normal_force():
    """On a plane that vibrates upwards: v - mu (g t - A w (1 - cos w t))."""
    plane = _plane(omega=20.0, amplitude=0.02, direction=np.pi / 2)
    made = jaxcam.simulate(plane, [0.0, 0.0, 2.0, 0.0], 0.0, 0.4)
    assert made.successful and not int(made.impacts.count)
    speed = 2 - 0.3 * (G * 0.4 - 0.4 * (1 - np.cos(8.0)))
    np.testing.assert_allclose(made.final[2], speed, atol=1e-11)


def test_lifting_off_does_not_depend_on_friction():
    """Hops, chatter and contact of the same block with and without friction."""
    heights = []
    for mu in (0.0, 0.3):
        plane = _plane(
            incline=0.1,
            friction_coefficient=mu,
            omega=8.0,
            amplitude=0.25,
            direction=np.pi / 2,
        )
        made = jaxcam.simulate(plane, [0.0, 0.0, 0.5, 0.0], 0.0, 2.0)
        assert made.successful, made.result
        assert int(made.impacts.count) > 5 and np.any(made.contacts.released)
        heights.append([made.final[1], made.final[3]])
    np.testing.assert_allclose(*heights, atol=1e-10)


@pytest.mark.slow
def test_derivatives_through_stick_slip_and_hops():
    """Against central differences of fourth order, to 1e-9."""
    plane = _plane(
        incline=0.1, omega=8.0, amplitude=0.25, direction=1.2, restitution=0.3
    )

    @jax.jit
    def end(values):
        system = eqx.tree_at(
            lambda s: (s.friction_coefficient, s.amplitude, s.incline),
            plane,
            tuple(values),
        )
        return flow(system, jnp.array([0.0, 0.0, 0.2, 0.0]), 0.0, 1.4).state

    at = jnp.array([0.3, 0.25, 0.1])
    found = jax.jacfwd(end)(at)
    for k in range(3):
        step = 1e-5 * jnp.eye(3)[k]
        near, far = (end(at + j * step) - end(at - j * step) for j in (1, 2))
        np.testing.assert_allclose(found[:, k], (8 * near - far) / 1.2e-4, atol=1e-9)


def test_a_sliding_ball_rolls_at_last():
    """After 2 v / (7 mu g), with 5/7 of the velocity, to 1e-12."""
    ball = SpinningBall(**parameters(friction_coefficient=0.2))
    made = jaxcam.simulate(ball, [0.0, 0.0, 1.4, 0.0, 0.0], 0.0, 1.0)
    assert made.successful, made.result
    np.testing.assert_allclose(made.switches.time, [0.4 / (0.2 * G)], atol=1e-12)
    np.testing.assert_allclose(made.final[2], 1.0, atol=1e-12)
    np.testing.assert_allclose(made.final[4], 1.0 / 0.02, atol=1e-10)


@pytest.mark.parametrize("velocity", [0.3, 5.0, -0.3, -5.0])
def test_an_impact_of_a_ball_grips_or_slips(velocity):
    """Slip: v - mu (1 + e) |u|; grip: 5/7 of the velocity without spin."""
    ball = SpinningBall(**parameters(friction_coefficient=0.25, restitution=0.7))
    made = jaxcam.simulate(ball, [0.0, 0.5, velocity, 0.0, 0.0], 0.0, 0.4)
    assert made.successful and int(made.impacts.count) == 1
    fall = np.sqrt(2 * G * 0.5)
    impulse = 0.25 * 1.7 * fall
    slips = 3.5 * impulse < abs(velocity)
    left = velocity - np.sign(velocity) * impulse if slips else 5 * velocity / 7
    spin = (velocity - left) / (0.4 * 0.02)
    np.testing.assert_allclose(made.final[2], left, atol=1e-12)
    np.testing.assert_allclose(made.final[4], spin, atol=1e-9)


def test_no_impact_creates_energy():
    """2000 impacts of random balls: to rounding."""
    random = np.random.default_rng(5)
    ball = SpinningBall(
        **parameters(
            friction_coefficient=random.uniform(0, 2, 2000),
            restitution=random.uniform(0, 1, 2000),
            inertia=random.uniform(0.1, 1, 2000),
            radius=np.full(2000, 0.02),
            gravity=np.full(2000, G),
        )
    )
    state = random.normal(size=(2000, 5)) * [1, 0, 1, 1, 50]
    state[:, 3] = -np.abs(state[:, 3])
    after = jax.vmap(lambda s, x: impacts(s, 0.0, x)[0])(ball, jnp.asarray(state))

    def energy(x):
        turns = np.asarray(ball.inertia) * (0.02 * x[:, 4]) ** 2
        return x[:, 2] ** 2 + x[:, 3] ** 2 + turns

    assert np.all(energy(np.asarray(after)) <= energy(state) * (1 + 1e-12))


def test_chatter_with_friction_ends_in_sliding():
    """The velocity after all impacts is that of the normal impulses."""
    ball = SpinningBall(**parameters(friction_coefficient=0.05, restitution=0.5))
    made = jaxcam.simulate(ball, [0.0, 0.2, 4.0, 0.0, 0.0], 0.0, 1.0)
    assert made.successful, made.result
    fall = np.sqrt(2 * 0.2 / G)
    # the floor carries the weight over the whole time but the first fall and its end
    start = float(made.contacts.start[0])
    np.testing.assert_allclose(start, 3 * fall, atol=1e-10)
    np.testing.assert_allclose(made.final[2], 4 - 0.05 * G, atol=1e-9)


class Crate(SwitchedSystem):
    """A crate on a rough floor that is pushed against a wall; unit mass."""

    friction: float = 0.2
    restitution: float = 0.5
    push: float = 5.0
    wall_friction: float = 0.0

    def switching(self, t, state):
        return state[2:]

    def branch(self, t, state, sides):
        zero = 0.0 * state[2]
        return jnp.stack([*state[2:], self.push + zero, zero - 9.81])

    def gap(self, t, state):
        return jnp.stack([state[1], -state[0]])

    def impact(self, t, state):
        rebound = -self.restitution
        return jnp.stack([state.at[3].multiply(rebound), state.at[2].multiply(rebound)])

    def contact_friction(self, t, state, sides):
        floor = jnp.zeros(4).at[2].set(-self.friction * sides[0])
        wall = jnp.zeros(4).at[3].set(-self.wall_friction * sides[1])
        return jnp.stack([floor, wall])


@pytest.mark.parametrize("wall_friction", [0.0, 0.3])
def test_chatter_against_a_wall_on_a_rough_floor(wall_friction):
    """It never leaves the floor, and rests at the wall; time to 1e-6 s.

    Every flight reverses, so the ratio of rebounds contains the friction.
    """
    crate = Crate(**parameters(wall_friction=wall_friction))
    run = jaxcam.simulate(crate, [-1.0, 0.0, 0.0, 0.0], 0.0, 3.0)
    assert run.successful, run.result
    # speeds just before the impacts, and times between them
    out, back = 5.0 + 0.2 * 9.81, 5.0 - 0.2 * 9.81
    speed, rest = np.sqrt(2 * back), np.sqrt(2 / back)
    for _ in range(100):
        rebound = 0.5 * speed
        speed = rebound * np.sqrt(back / out)
        rest += rebound / out + speed / back
    contacts = run.contacts
    assert int(contacts.count) == 2
    floor, wall = np.argsort(np.asarray(contacts.constraint)[:2])
    assert contacts.start[floor] == 0.0 and contacts.end[floor] == 3.0
    np.testing.assert_allclose(contacts.start[wall], rest, atol=1e-6)
    np.testing.assert_allclose(run.final, 0.0, atol=1e-12)
