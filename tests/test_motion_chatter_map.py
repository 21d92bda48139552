"""The completion of chatter against sums of impacts that are resolved one by one.

Gap y'' = a + j t - c y', launch speed v, restitution r0 + r1 (approach speed). Every
hop of it is a power series in time that is summed to rounding.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem, simulate
from jaxcam.hybrid.surface import chatter_completion, completion_time
from jaxcam.models import TripleIntegrator


class Damped(HybridSystem):
    """State (y, y', a): y'' = a - c y', a' = j."""

    damping: jax.Array
    jerk: jax.Array
    restitution: jax.Array
    softening: jax.Array

    def vector_field(self, t, state):
        return jnp.stack([state[1], state[2] - self.damping * state[1], self.jerk])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        r = self.restitution - self.softening * state[1]
        return jnp.stack([state[0], -r * state[1], state[2]])


def system(damping, jerk, restitution, softening=0.0):
    values = (damping, jerk, restitution, softening)
    return Damped(*(jnp.asarray(v, dtype=float) for v in values))


def hop(v, a, jerk, damping):
    """Duration of one hop and the approach speed at its end."""
    rates = [v, a - damping * v, jerk - damping * (a - damping * v)]
    while len(rates) < 24:
        rates.append(-damping * rates[-1])
    factorials = np.cumprod(np.arange(1.0, 25.0))
    height = np.array(rates) / factorials  # y / s in powers of s
    slope = np.array(rates) * np.arange(1, 25) / factorials
    powers = np.arange(24)
    s = -2 * v / a
    for _ in range(60):
        value = np.sum(height * s**powers)
        change = np.sum(height[1:] * powers[1:] * s ** powers[:-1])
        moved = value / change
        s -= moved
        if abs(moved) < 1e-16 * s:
            break
    return s, -np.sum(slope * s**powers)


def resolved(v, a, jerk, damping, r0, r1=0.0):
    """Impact times after the launch, down to hops that no longer count."""
    times, t, first = [], 0.0, v
    while v > 1e-20 * first:
        s, speed = hop(v, a + jerk * t, jerk, damping)
        t += s
        times.append(t)
        v = (r0 + r1 * speed) * speed
    return np.array(times)


@jax.jit
def completions(damped, v, a):
    state = jnp.stack([jnp.zeros_like(v), v, a])
    ends = [chatter_completion(damped, 0.0, state, order=order) for order in (1, 2)]
    return [(end.time, end.state, end.smallness) for end in ends]


CASES = [(-1.0, 0.7, 0.6), (-2.0, -1.5, 0.3), (-1.0, 0.5, 0.8)]


def orders(errors, ratio):
    errors = np.abs(errors)
    return np.log(errors[:-1] / errors[1:]) / np.log(ratio)


@pytest.mark.parametrize("damping", [0.0, 0.8])
@pytest.mark.parametrize("a, jerk, r", CASES)
def test_orders_two_and_three_in_the_launch_speed(a, jerk, r, damping):
    ratio = 2.0
    speeds = 0.08 * (1 - r) * a * a / abs(jerk) / ratio ** np.arange(5)
    exact = np.array([resolved(v, a, jerk, damping, r)[-1] for v in speeds])
    found = [
        completions(system(damping, jerk, r), jnp.asarray(v), jnp.asarray(a))
        for v in speeds
    ]
    for which, order in ((0, 2), (1, 3)):
        errors = np.array([float(f[which][0]) for f in found]) - exact
        observed = orders(errors, ratio)
        # each halving brings the observed order closer to the true one
        assert abs(observed[-1] - order) < 0.1
        assert abs(observed[-1] - order) <= abs(observed[0] - order) + 1e-3
        # the state there: on the surface, at rest, with the acceleration of that time
        last = np.array([f[which][1] for f in found])
        assert np.max(np.abs(last[:, :2])) < 1e-15
        drift = orders(last[:, 2] - (a + jerk * exact), ratio)
        assert abs(drift[-1] - order) < 0.1


@pytest.mark.parametrize("a, jerk, r", CASES)
def test_formulas_of_both_orders(a, jerk, r):
    v = 0.01
    first = -2 * v / (a * (1 - r))
    second = first - 4 / 3 * jerk * v**2 / (a**3 * (1 - r) ** 2)
    smallness = v * abs(jerk) / a**2 / (1 - r)
    found = completions(system(0.0, jerk, r), jnp.asarray(v), jnp.asarray(a))
    assert abs(float(found[0][0]) / first - 1) < 1e-14
    assert abs(float(found[1][0]) / second - 1) < 1e-14
    assert abs(float(found[1][2]) / smallness - 1) < 1e-13
    # and the thesis' system is the same with unit jerk
    end = chatter_completion(
        TripleIntegrator(restitution=r), 2.0, jnp.array([0.0, v, a])
    )
    second = first - 4 / 3 * v**2 / (a**3 * (1 - r) ** 2)
    assert abs(float(end.time) - 2 - second) < 1e-15


def test_unknown_order():
    with pytest.raises(ValueError, match="order 1 or 2"):
        chatter_completion(TripleIntegrator(), 0.0, jnp.array([0.0, 0.1, -1.0]), 3)


@pytest.mark.parametrize("softening", [0.3, -0.3])
@pytest.mark.parametrize("a, jerk, r", CASES)
def test_completion_time_with_restitution_that_depends_on_speed(a, jerk, r, softening):
    ratio, damping = 2.0, 0.4
    speeds = 0.04 * (1 - r) * a * a / abs(jerk) / ratio ** np.arange(5)
    exact = np.array([resolved(v, a, jerk, damping, r, softening)[-1] for v in speeds])
    # y'' changes by -damping with y'
    second = completion_time(speeds, a, jerk, -damping, r, softening)
    assert abs(orders(second - exact, ratio)[-1] - 3) < 0.1
    without = completion_time(speeds, a, jerk, -damping, r)
    assert abs(orders(without - exact, ratio)[-1] - 2) < 0.1


@pytest.mark.parametrize("softening", [0.0, -0.3])
def test_simulated_chatter_ends_with_the_resolved_sum(softening):
    a, jerk, r, damping, v = -1.0, 0.4, 0.6, 0.4, 0.2
    times = resolved(v, a, jerk, damping, r, softening)
    assert a + jerk * times[-1] < 0  # it comes to rest before it would let go
    trajectory = simulate(
        system(damping, jerk, r, softening), jnp.array([0.0, v, a]), 0.0, 2.4
    )
    assert trajectory.successful
    found = np.asarray(trajectory.impacts.time)
    assert np.max(np.abs(found - times[: len(found)])) < 1e-10  # s
    assert abs(float(trajectory.contacts.start[0]) - times[-1]) < 1e-10  # s
    # contact lasts until the acceleration has risen to zero
    assert int(trajectory.contacts.count) == 1
    assert not bool(trajectory.contacts.released[0])
    assert abs(float(trajectory.final[2]) - (a + jerk * 2.4)) < 1e-12
