"""A restitution law whose reference speed the rig file does not state."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.discrepancy import diagnose, library, Policy, Verdict
from jaxcam.discrepancy.search import (
    Search,
    system_question,
    Trials,
    with_fitted_speed,
)
from jaxcam.fitting import Model, Parameter, segment_by_model, Sensor
from jaxcam.recordings import Recording


class Ball(HybridSystem):
    """A ball above a floor."""

    gravity: float = 9.81
    restitution: float = 0.8

    def vector_field(self, t, state):
        return jnp.stack([state[1], -jnp.asarray(self.gravity)])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


_NOISE, _GRAVITY = 5e-4, 9.81
_SENSORS = {"height_m": Sensor(0, noise=_NOISE)}
_PARAMETERS = (
    Parameter("restitution", lambda m: m.system.restitution, 0.15, upper=1.0),
)


def _height(time, height):
    """A ball dropped at rest, with a coefficient of restitution of
    0.88 (1 + v/2)^-0.15: parabolas between impacts."""
    found, start, v, y = np.zeros_like(time), 0.0, 0.0, height
    while start < time[-1]:
        fall = (v + np.sqrt(v * v + 2 * _GRAVITY * y)) / _GRAVITY
        s = time - start
        inside = (s >= 0) & (s < fall)
        found[inside] = (y + v * s - _GRAVITY * s * s / 2)[inside]
        hit = _GRAVITY * fall - v
        start, y, v = start + fall, 0.0, 0.88 * hit * (1 + hit / 2.0) ** -0.15
    return found


@pytest.fixture(scope="module")
def drops():
    rng, time = np.random.default_rng(4), np.arange(400) / 240
    runs = []
    for k, height in enumerate((1.9, 1.4, 1.0, 0.6)):
        noisy = _height(time, height) + _NOISE * rng.standard_normal(len(time))
        runs.append(Recording(f"drop{k}", time, {"height_m": noisy}))
    return segment_by_model(Model(Ball(), _SENSORS), runs, _PARAMETERS)


@pytest.mark.slow
def test_an_unstated_reference_speed_is_fitted(drops):
    """v0 = 2 m/s and rb = 0.15 within four standard errors, each of less than 5 %;
    nothing else is named, and only noise is left (2 %)."""
    found = diagnose(Ball(), drops, sensors=_SENSORS, parameters=_PARAMETERS)
    assert (found.verdict, found.names) == (Verdict.EFFECT, ("restitution_velocity",))
    numbers = found.effects[0].parameters
    for name, true in (("rb", 0.15), ("v0", 2.0)):
        one = numbers[name]
        assert abs(one.value - true) < 4 * one.stderr < 0.2 * true
    assert found.heldout_after == pytest.approx(_NOISE, rel=0.02)
    assert "v0 = " in found.summary


@pytest.mark.slow
def test_a_stated_reference_speed_is_kept(drops):
    policy = Policy()

    def asked(terms, **stated):
        every = Ball(), drops, terms, _SENSORS, _PARAMETERS, None
        return system_question(*every, lambda sentence, fraction: None, policy, stated)

    question = asked(None)
    assert question.unstated == ("impact_speed",)
    assert asked(None, impact_speed=2.0).unstated == ()
    # given terms keep their constants
    assert asked(library(turned=False)).unstated == ()
    # with the right speed, another one explains no more
    right = question.relisted(question, question.references.__class__(impact_speed=2.0))
    trials = Trials(right.problem, right.rig, right.terms, policy, lambda s, f: None)
    assert with_fitted_speed(right, trials, Search(trials).run()) is None
