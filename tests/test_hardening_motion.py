"""The event loop where it hurts: restitution 0 and 1, slow and fast forcing.

What must hold of every run, whatever its numbers: it reaches its end or says why not,
nothing in it is NaN, and no gap is below -1e-9 of its scale.
"""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import simulate
from jaxcam.models import (
    BouncingBall,
    CamFollower,
    ConstantRestitution,
    ImpactOscillator,
)


SAMPLES = 2001
SPEEDS = (1e-3, 1e-1, 1.0, 30.0, 1e3)
G = 9.81


def sound(trajectory):
    """Check what holds of any run; whether it reached its end."""
    first, last = float(trajectory.t0), float(trajectory.steps.time[-1])
    if bool(trajectory.successful):
        assert int(trajectory.code) == 0 and trajectory.result == ""
        assert last == float(trajectory.t1)
    else:
        assert trajectory.result
    assert np.all(np.isfinite(trajectory.steps.time))
    assert np.all(np.diff(trajectory.steps.time) >= 0)
    assert np.all(np.isfinite(trajectory.steps.state))
    times = np.linspace(min(first, last), last, SAMPLES)
    gaps = np.asarray(trajectory.gap(times))
    scale = max(1.0, float(np.abs(np.asarray(trajectory.steps.state)[:, 0]).max()))
    assert np.all(gaps >= -1e-9 * scale), float(gaps.min())
    impacts = trajectory.impacts
    assert np.all(np.isfinite(impacts.time)) and np.all(np.diff(impacts.time) >= 0)
    # nobody leaves faster than it came, relative to a restitution of one
    before, after = np.asarray(impacts.speed_before), np.asarray(impacts.speed_after)
    assert np.all(np.abs(after) <= np.abs(before) * (1 + 1e-9) + 1e-12)
    return bool(trajectory.successful)


def array(x):
    return jnp.asarray(x, dtype=float)


# --- closed forms


@pytest.mark.parametrize("tolerance", [1e-14, 1e-10, 1e-4])
def test_ten_thousand_impacts_without_loss(tolerance):
    """A ball with r = 1 hits at (2 k - 1) sqrt(2 h / g) and keeps its speed."""
    ball = BouncingBall(restitution=array(1.0))
    fall = math.sqrt(2 * 1.0 / G)
    found = simulate(ball, [1.0, 0.0], 0.0, (2 * 10_000 + 0.5) * fall,
                     tolerance=tolerance)  # fmt: skip
    assert sound(found)
    assert int(found.impacts.count) == 10_000
    exact = fall * (2 * np.arange(1, 10_001) - 1)
    # rounding of 1e4 times added up
    np.testing.assert_allclose(found.impacts.time, exact, rtol=1e-10)
    np.testing.assert_allclose(found.impacts.speed_before, -G * fall, rtol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-14, 1e-4])
def test_one_impact_where_nothing_rebounds(tolerance):
    ball = BouncingBall(restitution=array(0.0))
    found = simulate(ball, [1.0, 0.0], 0.0, 3.0, tolerance=tolerance)
    assert sound(found)
    assert int(found.impacts.count) == 1 and int(found.contacts.count) == 1
    assert float(found.contacts.start[0]) == pytest.approx(math.sqrt(2 / G), rel=1e-12)
    assert found.final.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("omega", SPEEDS)
def test_a_ball_that_never_rebounds_from_a_shaken_floor(omega):
    """It leaves where the floor falls faster than g: sin(omega t) = g / (a omega^2)."""
    amplitude = 2 * G / omega**2
    ball = BouncingBall(
        restitution=array(0.0), amplitude=array(amplitude), frequency=array(omega)
    )
    # in contact, with the floor, where it does not fall faster than the ball
    start = [0.0, amplitude * omega]
    found = simulate(ball, start, 0.0, 20 * 2 * math.pi / omega, tolerance=1e-12)
    assert sound(found)
    assert int(found.contacts.count) >= 20
    left = np.asarray(found.contacts.end)[np.asarray(found.contacts.released)]
    np.testing.assert_allclose(np.sin(omega * left), 0.5, atol=1e-7)


# --- any numbers


@pytest.mark.parametrize("tolerance", [1e-14, 1e-8])
@pytest.mark.parametrize("r", [0.0, 0.7, 1.0])
def test_oscillator_at_any_frequency(r, tolerance):
    for omega in SPEEDS:
        system = ImpactOscillator(
            omega=array(omega), restitution=array(r), wall=array(0.0)
        )
        found = simulate(system, [-0.5, 0.3], 0.0, 200.0, tolerance=tolerance)
        reached = sound(found)
        # only what would need infinitely many impacts may stop
        assert reached or r == 1.0, (omega, found.result)


@pytest.mark.parametrize("r", [0.0, 0.5, 1.0])
def test_ball_at_any_frequency(r):
    for omega, strength in itertools.product(SPEEDS, (0.5, 3.0)):
        ball = BouncingBall(
            restitution=array(r),
            amplitude=array(strength * G / omega**2),
            frequency=array(omega),
        )
        height = 1.1 * strength * G / omega**2
        turns = 40 * 2 * math.pi / omega
        found = simulate(ball, [height, 0.0], 0.0, turns, tolerance=1e-14)
        reached = sound(found)
        assert reached or r == 1.0, (omega, strength, found.result)


@pytest.mark.slow
@pytest.mark.parametrize("r", [0.0, 0.5, 1.0])
def test_cam_at_any_speed(r):
    for speed in SPEEDS:
        system = CamFollower(
            speed=array(speed), restitution=ConstantRestitution(array(r))
        )
        found = simulate(system, [0.5, 0.0], 0.0, 3 * 2 * math.pi / speed,
                         tolerance=1e-12)  # fmt: skip
        reached = sound(found)
        assert reached or r == 1.0, (speed, found.result)


@pytest.mark.slow
def test_many_impacts_of_a_batch():
    """The same under vmap, where every run has the same room for its rows."""
    omega, r = (a.ravel() for a in np.meshgrid(SPEEDS, (0.0, 0.7, 1.0)))

    def one(omega, r):
        system = ImpactOscillator(omega=omega, restitution=r, wall=array(0.0))
        found = simulate(system, jnp.array([-0.5, 0.3]), 0.0, 10.0, max_steps=30_000)
        real = jnp.arange(found.steps.time.shape[0]) < found.steps.count
        gaps = -found.steps.state[:, 0]
        return found.code, jnp.min(jnp.where(real, gaps, jnp.inf)), real.sum()

    codes, gaps, rows = jax.jit(jax.vmap(one))(array(omega), array(r))
    assert np.all((np.asarray(codes) == 0) | (r == 1.0)), codes.tolist()
    assert np.all(np.asarray(gaps) >= -1e-9) and np.all(np.asarray(rows) > 1)
