"""Terms on one coordinate and one gap of several: closed forms of two bodies."""

from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam.discrepancy import library, Policy, strength, Term
from jaxcam.discrepancy.search import system_question
from jaxcam.discrepancy.terms import coordinates, WithTerms
from jaxcam.fitting import Parameter, Sensor
from jaxcam.fitting.engine import moves_surface
from jaxcam.hybrid import HybridSystem
from jaxcam.models import BouncingBall, CamFollower, ImpactOscillator
from jaxcam.recordings import Recording, segment


RATIO, RESTITUTION = 0.7, 0.6
PAIRS = ((0, 1), (2, 3))


class Pair(HybridSystem):
    """Two free masses, the second 0.7 times as heavy; the first has a wall."""

    state_names = ("x1", "v1", "x2", "v2")
    restitution: float = RESTITUTION

    def vector_field(self, t, state):
        none = jnp.zeros_like(state[0])
        return jnp.stack([state[1], none, state[3], none])

    def gap(self, t, state):
        return jnp.stack([state[0], state[2] - state[0]])

    def impact(self, t, state):
        x1, v1, x2, v2 = state
        common = (v1 + RATIO * v2) / (1 + RATIO)
        parting = self.restitution * (v1 - v2)
        w1 = common - RATIO * parting / (1 + RATIO)
        on_wall = jnp.stack([x1, -self.restitution * v1, x2, v2])
        return jnp.stack([on_wall, jnp.stack([x1, w1, x2, w1 + parting])])


class Softer(Term):
    """A restitution that is a share of what the model has."""

    name: ClassVar[str] = "softer"
    share: float = strength("-", 0.1)

    def restitution(self, approach, motion):
        return 1 - self.share


class Rising(Term):
    """A surface that rises at a constant speed."""

    name: ClassVar[str] = "rising"
    speed: float = strength("[q]/s", 0.1)

    def contact(self, motion):
        return self.speed * motion.t


class Push(Term):
    """A push by position and velocity."""

    name: ClassVar[str] = "push"
    force: float = strength("[q]/s^2", 0.1)

    def acceleration(self, motion):
        return self.force * (1 + motion.position + 10 * motion.velocity)


class Steady(Term):
    """A constant force."""

    name: ClassVar[str] = "steady"
    force: float = strength("[q]/s^2", 0.1)

    def acceleration(self, motion):
        return self.force * jnp.ones_like(motion.t)


def _near(found, expected):
    np.testing.assert_allclose(np.asarray(found), expected, rtol=1e-13, atol=1e-14)


STATE = jnp.array([0.2, 1.5, 0.2, -0.5])
TIME = jnp.asarray(0.3)


def test_coordinates_are_told_from_the_field():
    assert coordinates(Pair(), np.asarray(STATE)) == PAIRS


def test_positions_on_a_moving_base_are_coordinates():
    """x' = v - b'(t): the velocity is that in space."""

    class Shaken(HybridSystem):
        def vector_field(self, t, state):
            return jnp.stack([state[1] - jnp.cos(3 * t), -40.0 * state[0]])

        def gap(self, t, state):
            return state[0]

        def impact(self, t, state):
            return state

    assert coordinates(Shaken(), np.zeros(2)) == ((0, 1),)
    system = WithTerms(Shaken(), (Push(0.5),))
    seen = system.motion(TIME, STATE[:2], 0, Shaken().vector_field(TIME, STATE[:2]))
    _near(seen.velocity, STATE[1] - np.cos(3 * TIME))


def test_a_field_without_coordinates_is_refused():
    class Decay(HybridSystem):
        def vector_field(self, t, state):
            return -state

        def gap(self, t, state):
            return state[0]

        def impact(self, t, state):
            return state

    with pytest.raises(ValueError, match="has no coordinate.*must contain positions"):
        coordinates(Decay(), np.ones(2))


@pytest.mark.parametrize("place", [0, 1])
def test_a_term_pushes_its_own_coordinate(place):
    system = WithTerms(Pair(), (Push(0.5, coordinate=place),), PAIRS)
    change = system.vector_field(TIME, STATE) - Pair().vector_field(TIME, STATE)
    expected = np.zeros(4)
    q, v = PAIRS[place]
    expected[v] = 0.5 * (1 + STATE[q] + 10 * STATE[v])
    _near(change, expected)


def test_a_restitution_between_bodies_keeps_momentum():
    """The masses part at the new share of their approach; the wall is untouched."""
    system = WithTerms(Pair(), (Softer(0.25, constraint=1),), PAIRS)
    wall, masses = system.impact(TIME, STATE)
    _near(wall, Pair().impact(TIME, STATE)[0])
    _near(masses[1] + RATIO * masses[3], STATE[1] + RATIO * STATE[3])
    _near(masses[3] - masses[1], 0.75 * RESTITUTION * (STATE[1] - STATE[3]))


def test_a_rising_surface_between_bodies():
    """Approach and parting are relative to the surface, whichever body carries it."""
    rise = 0.3
    system = WithTerms(Pair(), (Rising(rise, constraint=1),), PAIRS)
    _near(system.gap(TIME, STATE), Pair().gap(TIME, STATE) - np.array([0, 0.3 * rise]))
    after = system.impact(TIME, STATE)[1]
    approach = STATE[1] - STATE[3] + rise
    _near(after[3] - after[1] - rise, RESTITUTION * approach)
    _near(after[1] + RATIO * after[3], STATE[1] + RATIO * STATE[3])


def test_an_impact_without_speed_stays_finite():
    still = jnp.array([0.2, 1.0, 0.2, 1.0])
    system = WithTerms(Pair(), (Softer(0.25, constraint=1),), PAIRS)
    _near(system.impact(TIME, still)[1], still)
    slope = jax.jacfwd(lambda x: system.impact(TIME, x)[1])(still)
    assert np.all(np.isfinite(slope))


def test_a_system_with_terms_on_several_coordinates_is_simulated():
    """The first mass meets the wall and the second one, in closed form."""
    terms = (Softer(0.25, constraint=1), Steady(-0.4, coordinate=1))
    system = WithTerms(Pair(), terms, PAIRS)
    start = jnp.array([0.1, -1.0, 0.5, -0.5])
    found = jaxcam.simulate(system, start, 0.0, 0.8)
    assert found.successful
    # off the wall at t = 0.1 with 0.6; then x2 - x1 = 0 at t = hit
    hit = np.roots([-0.2, -0.5 - RESTITUTION, 0.5 + 0.1 * RESTITUTION]).max()
    np.testing.assert_allclose(found.impacts.time, [0.1, hit], rtol=1e-12)
    v1, v2 = RESTITUTION, -0.5 - 0.4 * hit
    parting = 0.75 * RESTITUTION * (v1 - v2)
    w1 = (v1 + RATIO * v2 - RATIO * parting) / (1 + RATIO)
    x, left = RESTITUTION * (hit - 0.1), 0.8 - hit
    expected = [
        x + w1 * left,
        w1,
        x + (w1 + parting) * left - 0.2 * left**2,
        w1 + parting - 0.4 * left,
    ]
    np.testing.assert_allclose(found.final, expected, rtol=1e-10)


def test_units_are_those_of_the_coordinate():
    (friction,) = [t for t in library(turned=False) if t.name == "coulomb_friction"]
    in_metres = eqx.tree_at(lambda t: t.fc, friction, jnp.asarray(0.0))
    assert in_metres.strengths()[0].unit == "rad/s^2"
    assert type(friction)(motion_unit="m").strengths()[0].unit == "m/s^2"


def test_a_profile_error_requires_a_surface_that_the_drive_moves():
    """The wall of an oscillator with a periodic force is fixed; the cam and the
    vibrating floor move, the latter even with the amplitude zero of its default."""
    assert not moves_surface(ImpactOscillator(), np.zeros(2))
    assert moves_surface(CamFollower(), np.zeros(2))
    assert moves_surface(BouncingBall(amplitude=0.0), np.zeros(2))
    fixed = {term.name for term in library(profiled=False)}
    assert {term.name for term in library()} - fixed == {"cam_profile_error"}


@pytest.mark.slow
def test_a_forced_rig_with_a_fixed_wall_is_not_offered_a_profile_error():
    """The list of a question contains no profile error for a fixed wall, and one for a
    vibrating floor; both contain the sensor lag, whose time origin the forcing
    fixes."""
    time, rng, channel = 0.02 * np.arange(200), np.random.default_rng(0), "height_m"
    motions = 5.0 + np.sin(time) + 1e-3 * rng.normal(size=(2, 200))
    runs = [Recording(f"run{k}", time, {channel: x}) for k, x in enumerate(motions)]
    runs = [segment(run, channel) for run in runs]
    sensors = {channel: Sensor(0, noise=1e-3)}
    bounce = Parameter("restitution", lambda m: m.system.restitution, 0.1)
    for system, moves in ((ImpactOscillator(wall=10.0), False), (BouncingBall(), True)):
        every = system, runs, None, sensors, (bounce,), None
        question = system_question(*every, lambda said, part: None, Policy())
        names = {term.name for term in question.terms}
        assert ("cam_profile_error" in names) is moves
        assert "sensor_lag" in names and question.turned
