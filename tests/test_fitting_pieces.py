"""Recordings cut into pieces that a model can follow."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam.fitting import fit, Parameter, Problem, Sensor
from jaxcam.fitting.engine import DriveState
from jaxcam.fitting.engine._fly import fly
from jaxcam.fitting.engine._layout import Layout
from jaxcam.fitting.engine._model import Model
from jaxcam.fitting.engine._pieces import _PIECE, spans
from jaxcam.fitting.engine._predict import contact_state
from jaxcam.hybrid import HybridSystem
from jaxcam.models import BouncingBall
from jaxcam.recordings import Recording, segment


def test_a_contact_of_which_little_is_sure_is_cut_by_time():
    """Predictions of a piece are interpolated: none may last longer than `_PIECE`.

    Of a long contact every two hundredth sample is beyond doubt; all of them are kept,
    once each.
    """
    time = 5e-4 * np.arange(8000)
    floor = 0.01 * np.sin(12.0 * time)
    height = floor + 1e-4 * np.random.default_rng(1).standard_normal(len(time))
    found = segment(Recording("rest", time, {"height": height}), "height", floor)
    sure = np.arange(len(time)) % 200 < 3
    flown, rested = spans(dataclasses.replace(found, sure=sure))
    assert not flown and len(found.contacts) == 1
    kept = np.concatenate([span.rows for span in rested])
    expected = np.flatnonzero(sure & found.resting(found.contacts[0]))
    assert np.array_equal(np.sort(kept), expected) and len(kept) == len(set(kept))
    longest = max(span.stop - span.start for span in rested)
    assert longest <= _PIECE * 5e-4 * (1 + 1e-9)


def test_a_flight_begins_where_its_release_is_sure():
    """Samples within the standard error of a release belong to the contact perhaps."""
    time = 5e-4 * np.arange(3000)
    floor = np.zeros(3000)
    height = np.maximum(0.0, 2.0 * (time - 0.5) * (1.2 - time))
    height = height + 1e-5 * np.random.default_rng(1).standard_normal(3000)
    found = segment(Recording("hop", time, {"height": height}), "height", floor)
    (flight,) = (one for one in found.flights if one.start.kind == "release")
    for stderr in (5e-4, 0.05):
        start = dataclasses.replace(flight.start, stderr=stderr)
        changed = dataclasses.replace(flight, start=start)
        flown, _ = spans(dataclasses.replace(found, flights=(changed,)))
        first = time[min(int(span.rows[0]) for span in flown)]
        assert start.time + stderr <= first < start.time + stderr + 2e-3


def _on_the_floor(values):
    """State and rate of a ball that rests on a floor, by amplitude and frequency."""
    amplitude, frequency = values
    ball = BouncingBall(amplitude=amplitude, frequency=frequency)
    (state,), (rate,) = contact_state(ball, jnp.asarray(0.3), jnp.array([0.1, 0.2]))
    return jnp.concatenate([state, rate])


def test_a_state_in_contact_moves_with_the_surface():
    """Against the closed form, values and derivatives to 1e-12."""

    def exact(values):
        a, w = values
        high, fast = a * jnp.sin(0.3 * w), a * w * jnp.cos(0.3 * w)
        return jnp.stack([high, fast, fast, -(w**2) * high])

    values = jnp.array([0.02, 7.0])
    for of in (lambda f: f, jax.jacfwd):
        found, expected = (np.asarray(of(f)(values)) for f in (_on_the_floor, exact))
        assert found == pytest.approx(expected, abs=1e-12)


def test_a_model_to_first_order_has_the_derivatives_of_the_model():
    """Also of what is worked out for every step; columns in units of their scales."""
    model = Model(BouncingBall(), {}, None)

    def squared(model):
        gravity = model.system.gravity
        moved = dataclasses.replace(model.system, gravity=gravity**2)
        return dataclasses.replace(model, system=moved)

    leaves = jax.tree.leaves(model)
    layout = Layout(model, tuple(range(len(leaves))), squared)
    values = jnp.arange(1.0, 1.0 + len(leaves))
    columns, scales = jnp.array([2, 0]), jnp.array([0.5, 3.0])
    near = layout.about(values).by(columns, scales)

    def direct(change):
        return jax.tree.leaves(layout.at(values.at[columns].add(change * scales)))

    def expanded(change):
        return jax.tree.leaves(near.at(change))

    origin = jnp.zeros(2)
    assert np.array(direct(origin)) == pytest.approx(np.array(expanded(origin)))
    slopes = (np.array(jax.jacfwd(f)(origin)) for f in (direct, expanded))
    assert next(slopes) == pytest.approx(next(slopes), rel=1e-14)


class Spring(HybridSystem):
    """An undamped oscillator that touches nothing."""

    stiffness: jax.Array = eqx.field(default=4.0, converter=jnp.asarray)

    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.stiffness * state[0]])

    def gap(self, t, state):
        return state[0] + 10.0

    def impact(self, t, state):
        return state


def _ends(stiffness, substeps):
    model = Model(Spring(stiffness), {"x": Sensor(0, noise=1e-3)})
    start, step, still = jnp.array([1.0, 0.0]), jnp.asarray(0.1), jnp.zeros(10)
    drive = DriveState(still, still, still)
    return fly(model, start, jnp.asarray(0.0), step, drive, substeps)


def test_substeps_refine_the_values_and_leave_the_derivatives():
    """Four substeps leave some 1/256 of the error, at the end and on the way.

    The exact motion is cos(w t) with w = 2 1/s.
    """
    angle = 0.2 * jnp.arange(1.0, 11.0)
    errors = []
    for substeps in (1, 4):
        end, nodes = _ends(jnp.asarray(4.0), substeps)
        exact = jnp.array([jnp.cos(angle[-1]), -2 * jnp.sin(angle[-1])])
        errors.append(jnp.abs(end - exact))
        on_the_way = jnp.max(jnp.abs(nodes.right[:, 0] - jnp.cos(angle)))
        slopes = jnp.max(jnp.abs(nodes.right_rate[:, 0] + 2 * jnp.sin(angle)))
        assert on_the_way < 3e-5 / substeps**4 and slopes < 1e-4 / substeps**4
    ratio = errors[0] / errors[1]
    assert np.all((ratio > 150) & (ratio < 300))
    slopes = [jax.jacfwd(lambda k, n=n: _ends(k, n))(jnp.asarray(4.0)) for n in (1, 4)]
    for one, two in zip(*map(jax.tree.leaves, slopes), strict=True):
        assert np.allclose(one, two, rtol=0, atol=1e-15)


def test_a_long_flight_is_divided_into_substeps_instead_of_more_steps():
    """A frequency error adds up over the pieces: the fit is as good as its noise."""
    rng, time = np.random.default_rng(3), 0.02 * np.arange(4000)
    height = np.cos(2.0 * time) + 1e-4 * rng.standard_normal(len(time))
    parts = segment(Recording("free", time, {"x": height}), "x", -10.0 + 0 * time)
    model = Model(Spring(4.0), {"x": Sensor(0, noise=1e-4)})
    stiffness = Parameter("stiffness", lambda m: m.system.stiffness)
    problem = Problem.build(model, [parts], [stiffness])
    assert problem.pieces.steps <= 20 and problem.pieces.substeps > 1
    found = fit(problem)
    assert found.converged
    assert abs(found["stiffness"].value - 4.0) < 4 * found["stiffness"].stderr
    assert found["stiffness"].stderr < 1e-6
