"""Contacts whose release is known are skipped in batches: the samples stay the same."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.hybrid import HybridSystem, Settings, stroboscope
from jaxcam.models import CamFollower, ImpactOscillator


class _WrongPeriod(ImpactOscillator):
    """Its `period` is not the period of the force."""

    @property
    def period(self):
        return 1.07 * 2 * jnp.pi / self.omega


class _TwoStops(HybridSystem):
    """Two stops that are one constraint: contacts at -1 and at 1 are different."""

    push: float = 0.9
    slow: float = 0.0

    @property
    def period(self):
        return jnp.asarray(jnp.pi)

    def vector_field(self, t, state):
        push = self.push * jnp.cos(2 * t) * jnp.cos(self.slow * t)
        return jnp.stack([state[1], push + 0.6 * state[0] - 0.2 * state[1]])

    def gap(self, t, state):
        return 1.0 - state[0] ** 2

    def impact(self, t, state):
        return jnp.stack([state[0], -0.3 * state[1]])


def _both(system, states, turns, **options):
    """Samples of the LLVM backend, which skips contacts, and of XLA, which does not."""

    def by(backend):
        settings = Settings(tolerance=1e-9, chatter_depth=1.0, backend=backend)
        return stroboscope(system, states, turns, settings=settings, **options)

    return by("llvm"), by("xla")


def _starts(low: float, high: float) -> np.ndarray:
    return np.stack([np.linspace(low, high, 16), np.zeros(16)], axis=1)


CASES = {
    "cam, one contact a turn": (CamFollower(speed=14.7), _starts(0.36, 0.45), {}),
    # samples are taken at phases before, in and after the contact
    "cam, samples later": (CamFollower(speed=14.7), _starts(0.36, 0.45), {"t0": 0.2}),
    "oscillator": (
        ImpactOscillator(omega=0.7, restitution=0.3, wall=-0.5),
        _starts(-2.0, -0.6),
        {},
    ),
    "oscillator, samples in contact": (
        ImpactOscillator(omega=0.7, restitution=0.3, wall=0.0),
        _starts(-1.5, -0.1),
        {"t0": 2.0},
    ),
    "two surfaces": (_TwoStops(), _starts(-0.9, 0.9), {}),
}


@pytest.mark.parametrize("name", CASES)
def test_samples_are_those_of_a_run_that_skips_no_contact(name):
    """States differ by less than the tolerance 1e-9; events are the same."""
    system, states, options = CASES[name]
    skipping, whole = _both(system, states, 20, **options)
    assert np.all(skipping.code == 0) and np.all(whole.code == 0)
    assert np.max(np.abs(skipping.states - whole.states)) < 1e-9
    np.testing.assert_array_equal(skipping.hits, whole.hits)
    np.testing.assert_array_equal(skipping.rests, whole.rests)
    assert np.sum(whole.rests) > 100
    assert np.sum(skipping.steps) < 0.95 * np.sum(whole.steps)


def test_a_sweep_learns_the_release_of_each_speed():
    """Releases differ between elements: 24 speeds, states within 1e-9."""
    speeds = np.linspace(12.6, 15.7, 24)
    states = np.tile([0.4, 0.0], (24, 1))
    skipping, whole = _both(
        CamFollower(), states, 15, where=lambda s: s.speed, values=speeds
    )
    assert np.max(np.abs(skipping.states - whole.states)) < 1e-9
    assert np.sum(skipping.steps) < 0.95 * np.sum(whole.steps)


def test_a_wrong_period_skips_nothing():
    """A release that does not repeat is never used: states within 1e-9."""
    system = _WrongPeriod(omega=0.7, restitution=0.3, wall=-0.1)
    skipping, whole = _both(system, _starts(-1.5, -0.2), 20)
    assert np.sum(whole.rests) > 50
    assert np.max(np.abs(skipping.states - whole.states)) < 1e-9
    np.testing.assert_array_equal(skipping.steps, whole.steps)


def test_a_contact_at_another_surface_is_not_skipped():
    """The body changes from one stop to the other: states within 1e-9."""
    skipping, whole = _both(_TwoStops(push=1.5, slow=0.2), _starts(-0.9, 0.9), 20)
    assert np.min(whole.states[:, :, 0]) < -0.99 and np.max(whole.states) > 0.99
    assert np.sum(whole.rests) > 50
    assert np.max(np.abs(skipping.states - whole.states)) < 1e-9
