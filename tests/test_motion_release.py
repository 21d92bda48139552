"""Second derivatives through release, against closed forms."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem, simulate
from jaxcam.hybrid.surface import contact_state, release_point
from jaxcam.hybrid.surface._release_point import contact_acceleration
from jaxcam.models import BouncingBall, CamFollower


# gravity, restitution, amplitude, frequency
_TABLE = jnp.array([9.81, 0.35, 0.3, 6.5])


class BallByPhase(HybridSystem):
    """The bouncing ball with the phase of its table as a third state."""

    gravity: jax.Array
    restitution: jax.Array
    amplitude: jax.Array
    frequency: jax.Array

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.gravity, self.frequency])

    def gap(self, t, state):
        return state[0] - self.amplitude * jnp.sin(state[2])

    def impact(self, t, state):
        floor = self.amplitude * self.frequency * jnp.cos(state[2])
        return state.at[1].add(-(1 + self.restitution) * (state[1] - floor))


def _motion(numbers, kind):
    """Release after a chatter, the state some time later, and another between."""
    start = jnp.array([0.1, 0.0, 0.0])[: 2 if kind is BouncingBall else 3]
    g, r, a, w = numbers
    system = kind(gravity=g, restitution=r, amplitude=a, frequency=w)
    made = simulate(system, start, 0.0, 1.2, max_steps=512)
    sample = made.at(jnp.array([1.15]))[0, :2]
    found = jnp.concatenate([made.contacts.end[:1], made.final[:2], sample])
    return found, made.code


def _exact(numbers):
    """The table lets go where A w^2 sin(w t) = g; free fall follows."""
    g, _, a, w = numbers
    t = (jnp.arcsin(g / (a * w * w)) + 2 * jnp.pi) / w

    def fall(end):
        late = end - t
        speed = a * w * jnp.cos(w * t)
        height = a * jnp.sin(w * t) + late * speed - g * late**2 / 2
        return jnp.stack([height, speed - g * late])

    return jnp.concatenate([t[None], fall(1.2), fall(1.15)])


def _twice(function, numbers, direction):
    """Value, first and second derivative along a direction, and what comes with it."""

    def slope(p):
        value, rate, code = jax.jvp(function, (p,), (direction,), has_aux=True)
        return rate, (value, code)

    rate, bend, (value, code) = jax.jvp(slope, (numbers,), (direction,), has_aux=True)
    return (value, rate, bend), code


@pytest.mark.parametrize(
    "kind", [BouncingBall, pytest.param(BallByPhase, marks=pytest.mark.slow)]
)
def test_second_derivatives_behind_the_release_of_a_moving_table(kind):
    """Release and states, twice along directions in all parameters, to 1e-10.

    The first direction is that of the restitution, of which nothing here depends.
    """
    second = jax.jit(lambda p, u: _twice(lambda q: _motion(q, kind), p, u))
    for direction in ([0.0, 1.0, 0.0, 0.0], [1.0, 0.3, 0.05, -1.0]):
        direction = jnp.array(direction)
        (value, slope, bend), code = second(_TABLE, direction)
        assert int(code) == 0
        (exact, exact_slope, exact_bend), _ = _twice(
            lambda q: (_exact(q), 0), _TABLE, direction
        )
        scale = 1.0 + np.max(np.abs(exact_bend))
        np.testing.assert_allclose(value, exact, rtol=0, atol=1e-12)
        np.testing.assert_allclose(slope, exact_slope, rtol=0, atol=1e-11 * scale)
        np.testing.assert_allclose(bend, exact_bend, rtol=0, atol=1e-10 * scale)


@pytest.mark.slow
def test_second_derivative_of_the_release_from_a_cam():
    """By the speed of the shaft, against Newton's method on the multiplier, to 1e-9."""
    speed = 15.5

    def system(s):
        return CamFollower(speed=s)

    # the last release before some time in flight
    times = np.linspace(0.0, float(system(speed).period), 40)
    pull = np.asarray(contact_acceleration(system(speed), times, jnp.zeros(2)))
    later = float(times[np.argmax(pull)])
    release = release_point(system(speed), later)
    assert float(release.holds) == 0
    begin = float(release.time) - 0.02
    state = contact_state(system(speed), jnp.array([begin]), jnp.zeros(2))[0]
    end = float(release.time) + 0.02

    def found(s):
        # gap and velocity zero fix the state, whatever the speed
        start = contact_state(system(s), jnp.array([begin]), state)[0]
        made = simulate(system(s), start, begin, end, max_steps=64)
        return made.contacts.end[0], made.code

    def exact(s):
        return release_point(system(s), end).time, 0

    speed, one = jnp.asarray(speed), jnp.asarray(1.0)
    values, code = jax.jit(lambda s: _twice(found, s, one))(speed)
    truth, _ = jax.jit(lambda s: _twice(exact, s, one))(speed)
    assert int(code) == 0
    np.testing.assert_allclose(values, truth, rtol=1e-9)
