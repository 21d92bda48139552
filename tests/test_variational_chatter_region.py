"""The region of complete chattering and the curves that graze, against simulation."""

import equinox as eqx
import jax.numpy as jnp
import mpmath
import numpy as np
import pytest
from oscillator_hops import oscillator_hop

import jaxcam
from jaxcam.models import ImpactOscillator
from variational import (
    chatter_frame,
    chattering_region,
    grazing_manifold,
    Reversed,
    scaling_law,
)
from variational.chatter import surface_state


W, R = 0.6, 0.5


@pytest.fixture(scope="module")
def oscillator():
    return ImpactOscillator(omega=jnp.asarray(W), restitution=jnp.asarray(R))


@pytest.fixture(scope="module")
def manifold(oscillator):
    return grazing_manifold(oscillator, n=3, points=8)


@eqx.filter_jit
def simulated(system, state, t0, t1):
    return jaxcam.simulate(system, state, t0, t1, max_steps=256)


def followed(system, state, t0, t1):
    # arrays, so that one compiled program serves all times
    return simulated(system, state, jnp.asarray(t0), jnp.asarray(t1))


def on_wall(system, time, speed):
    return surface_state(system, jnp.asarray(time), jnp.asarray(speed))


def test_images_are_the_impacts_that_follow_grazing(oscillator, manifold):
    period = float(oscillator.period)
    times, speeds = np.asarray(manifold.after.time), np.asarray(manifold.after.speed)
    assert np.all(np.isfinite(speeds))
    for k, start in enumerate(np.asarray(manifold.grazing)):
        state = on_wall(oscillator, start, 0.0)
        motion = followed(oscillator, state, start, start + 6 * period)
        count = int(motion.impacts.count)
        assert count >= 3
        # an impact of no speed at the start itself may be listed
        first = int(np.argmax(np.asarray(motion.impacts.time) > start + 1e-6))
        some = slice(first, first + 3)
        found = np.asarray(motion.impacts.time)[some]
        after = np.asarray(motion.impacts.speed_after)[some, ...].reshape(3, -1)
        np.testing.assert_allclose(found, times[:, k], rtol=0, atol=1e-7)
        np.testing.assert_allclose(np.abs(after[:, 0]), speeds[:, k], atol=1e-7)


def test_preimages_graze_when_run_forward(oscillator, manifold):
    before = manifold.before
    tested = 0
    for n in range(3):
        for k, graze in enumerate(np.asarray(manifold.grazing)):
            time, speed = float(before.time[n, k]), float(before.speed[n, k])
            if not np.isfinite(speed):
                continue
            state = on_wall(oscillator, time, speed)
            # a moment before: at the touch itself an impact may or may not be counted
            early = 1e-3
            motion = followed(oscillator, state, time, float(graze) - early)
            listed = np.asarray(motion.impacts.time)[: int(motion.impacts.count)]
            assert int(np.sum(listed > time + 1e-9)) == n
            # a grazing motion leaves as x = -a s^2/2, a the pull there
            end = np.asarray(motion.steps.state)[int(motion.steps.count) - 1]
            pull = -np.cos(W * graze)
            np.testing.assert_allclose(end[0], -pull * early**2 / 2, atol=2e-9)
            np.testing.assert_allclose(end[1], pull * early, atol=2e-6)
            tested += 1
    assert tested >= 12


@pytest.mark.parametrize("damping", [0.0, 0.1])
def test_reversed_motion_returns_to_its_start(oscillator, damping):
    system = eqx.tree_at(lambda s: s.damping, oscillator, jnp.asarray(damping))
    # before it sticks: that forgets the past
    start, end = jnp.asarray([-0.7, 0.4]), 10.5
    there = followed(system, start, 0.0, end)
    assert int(there.impacts.count) >= 2
    state = there.steps.state[there.steps.count - 1]
    back = followed(Reversed(system), state, -end, 0.0)
    assert int(back.impacts.count) == int(there.impacts.count)
    arrived = np.asarray(back.steps.state[back.steps.count - 1])
    np.testing.assert_allclose(arrived, start, atol=1e-6)


def curve(oscillator):
    """C, ordered backwards from release, one row for each impact before release."""
    region = chattering_region(oscillator, points=6, impacts=14)
    return np.asarray(region.time), np.asarray(region.speed)


def test_a_point_inside_sticks_before_release_and_one_outside_does_not(oscillator):
    release = float(chatter_frame(oscillator).release)
    times, speeds = curve(oscillator)
    some = np.flatnonzero(np.isfinite(speeds) & (times > release - 5.0))[20::8]
    assert len(some) >= 5
    for k in some:
        for factor, inside in ((0.99, True), (1.01, False)):
            state = on_wall(oscillator, times[k], factor * speeds[k])
            motion = followed(oscillator, state, times[k], release + 0.1)
            ends = np.asarray(motion.contacts.end)
            stuck = np.any(np.abs(ends - release) < 1e-9)
            assert stuck == inside


def test_the_boundary_against_flights_of_forty_digits(oscillator):
    release = float(chatter_frame(oscillator).release)
    times, speeds = curve(oscillator)
    bar = float(scaling_law(R).lambda_bar)

    def completes(t, u):
        with mpmath.workdps(40):
            w, t, u = mpmath.mpf(W), mpmath.mpf(t), mpmath.mpf(u)
            for _ in range(200):
                hop = oscillator_hop(w, t, u)
                if hop is None or hop[0] >= release:
                    return False
                t, u = hop[0], R * hop[1]
                lam = float(u / (w * (t - release) ** 2))
                if release - t < 1e-2 and lam < bar / 2:
                    return True
                if lam > 3 / 8 and release - t < 1e-2:
                    return False
        raise AssertionError("neither in 200 impacts")

    # the backward map reduces the error of the parabola, 1e-3, by q an impact
    far = np.flatnonzero(np.isfinite(speeds) & (times > release - 5.0))[-12::4]
    for k in far:
        assert completes(times[k], speeds[k] * (1 - 1e-5))
        assert not completes(times[k], speeds[k] * (1 + 1e-5))
