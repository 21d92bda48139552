"""A restitution law whose reference speed the rig file does not state."""

import dataclasses
import math
from types import SimpleNamespace
from typing import NamedTuple

import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.cli._restitution_figure import restitution
from jaxcam.discrepancy import diagnose, library, Policy, Verdict
from jaxcam.discrepancy.search import (
    Search,
    system_question,
    Trials,
    with_fitted_speed,
)
from jaxcam.discrepancy.search._reference_speed import _of_fits
from jaxcam.discrepancy.terms import system_with_terms
from jaxcam.discrepancy.terms._restitution import RestitutionVelocity
from jaxcam.fitting import Fit, fit, Model, Parameter, Problem, segment_by_model, Sensor
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


def _hits(height):
    """The exact approach speeds of such a ball."""
    speeds, hit = [], np.sqrt(2 * _GRAVITY * height)
    while len(speeds) < 20:
        speeds.append(hit)
        hit = 0.88 * hit * (1 + hit / 2.0) ** -0.15
    return speeds


_HEIGHTS = (1.9, 1.4, 1.0, 0.6)


@pytest.fixture(scope="module")
def drops():
    rng, time = np.random.default_rng(4), np.arange(400) / 240
    runs = []
    for k, height in enumerate(_HEIGHTS):
        noisy = _height(time, height) + _NOISE * rng.standard_normal(len(time))
        runs.append(Recording(f"drop{k}", time, {"height_m": noisy}))
    return segment_by_model(Model(Ball(), _SENSORS), runs, _PARAMETERS)


class _Found(NamedTuple):
    """The fits of a diagnosis, as its figure of the law needs them."""

    before: Fit
    after: Fit

    def system(self):
        return self.after.model().system


@pytest.mark.usefixtures("unchecked_types")
def test_the_law_is_drawn_over_the_approach_speeds(drops):
    """The curve is r0 (1 + v/2)^-rb with the fitted numbers (1e-12), its band twice
    the standard error of that expression (1e-6); the textbook curve is constant."""
    (term,) = (one for one in library() if one.name == "restitution_velocity")
    term = dataclasses.replace(term, reference=jnp.asarray(2.0))
    rb = Parameter("rb", lambda m: m.system.terms[0].rb, 0.5)
    r0 = Parameter("restitution", lambda m: m.system.base.restitution, 0.15)
    law = Model(system_with_terms(Ball(), (term,)), _SENSORS)
    # a filter adds its state to those of the system
    slow = {"height_m": Sensor(0, noise=_NOISE, bandwidth_hz=200.0)}
    before = fit(Problem.build(Model(Ball(), slow), drops, _PARAMETERS))
    after = fit(Problem.build(law, drops, (r0, rb)))
    figure = restitution(plt, _Found(before, after))
    (axis,) = figure.axes
    lines = {line.get_label().split(" ±")[0]: line for line in axis.lines}
    textbook, curve = lines["textbook model"], lines["with the missing effects"]
    impacts = lines["recorded impacts"]
    speed = curve.get_xdata()
    values = {one.name: one.value for one in after.estimates}
    expected = values["restitution"] * (1 + speed / 2.0) ** -values["rb"]
    np.testing.assert_allclose(curve.get_ydata(), expected, rtol=1e-12)
    assert np.ptp(textbook.get_ydata()) < 1e-12
    # the marks are the speeds of the fitted flights, accurate to 1e-4; those of local
    # fits to single flights scatter by 2 %
    marks, local = (
        np.asarray(impacts.get_xdata()),
        np.concatenate([part.impacts.approach for part in drops]),
    )
    exact = np.concatenate(
        [
            hits[: part.impacts.count]
            for hits, part in zip(map(_hits, _HEIGHTS), drops, strict=True)
        ]
    )
    assert len(marks) == len(local) == len(exact)
    assert np.max(np.abs(marks / exact - 1)) < 1e-3
    assert np.std(local / exact) > 5e-3
    names = [one.name for one in after.estimates]
    push = np.zeros((len(speed), 2))
    push[:, names.index("restitution")] = expected / values["restitution"]
    push[:, names.index("rb")] = -expected * np.log1p(speed / 2.0)
    error = np.sqrt(np.einsum("kp,pq,kq->k", push, after.covariance, push))
    edges = axis.collections[1].get_paths()[0].vertices[:, 1]
    assert np.max(edges) == pytest.approx(np.max(expected + 2 * error), rel=1e-6)
    plt.close(figure)


@pytest.mark.parametrize("change", [0.1, 0.03])
def test_the_speed_is_the_vertex_of_a_parabola_through_costs(change, unchecked_types):
    """For a quadratic cost, exactly, with the error of the speed and of a value that
    changes by 0.4 times its logarithm; a far vertex is approached by one step.
    """
    term = RestitutionVelocity(motion_unit="m")

    def found(vertex):
        def fit_at(step):
            rb = SimpleNamespace(label="rb", value=0.1 + 0.4 * step)
            cost = 10.0 + 800.0 * (step - vertex) ** 2
            return SimpleNamespace(cost=cost, estimates=(rb,))

        near = [fit_at(step) for step in (-change, 0.0, change)]
        return _of_fits(term, math.log(2.0), near, change)  # pyright: ignore

    one = found(0.01)
    assert one.speed.value == pytest.approx(2.0 * math.exp(0.01), rel=1e-9)
    assert one.speed.stderr == pytest.approx(one.speed.value / math.sqrt(800), rel=1e-9)
    assert one.errors["rb"] == pytest.approx(0.4 / math.sqrt(800), rel=1e-9)
    far = found(5.0).speed.value
    assert far == pytest.approx(2.0 * math.exp(change), rel=1e-9)


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
