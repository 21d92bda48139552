"""Fits of systems with switching surfaces: events of a piece, and their derivatives."""

import functools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import jaxcam
from jaxcam.fitting import (
    Doubt,
    fit,
    free_run,
    Model,
    Parameter,
    Problem,
    segment_by_model,
    Sensor,
)
from jaxcam.fitting.engine._fly import fly, fly_without_derivatives
from jaxcam.fitting.engine._model import DriveState
from jaxcam.hybrid import flow, Settings, SwitchedSystem
from jaxcam.recordings import record, Wandering


SHARP = Settings(tolerance=1e-12)
SENSORS = {"position_m": Sensor(0, noise=1e-5)}


class Cart(SwitchedSystem):
    """A sprung cart with dry friction and a soft stop, on a shaken base."""

    state_names = ("position", "velocity")
    stiffness: jax.Array = eqx.field(default=60.0, converter=jnp.asarray)
    friction: jax.Array = eqx.field(default=0.6, converter=jnp.asarray)
    static: jax.Array = eqx.field(default=1.0, converter=jnp.asarray)
    stop: jax.Array = eqx.field(default=0.03, converter=jnp.asarray)
    stop_stiffness: jax.Array = eqx.field(default=2000.0, converter=jnp.asarray)
    amplitude: jax.Array = eqx.field(default=1.5, converter=jnp.asarray)
    speed: jax.Array = eqx.field(default=7.0, converter=jnp.asarray)

    def switching(self, t, state):
        return jnp.stack([state[1], state[0] - self.stop])

    def branch(self, t, state, sides):
        pressed = jnp.where(sides[1] > 0, state[0] - self.stop, 0.0)
        force = self.amplitude * jnp.cos(self.speed * t) - self.stiffness * state[0]
        force = force - self.stop_stiffness * pressed - self.friction * sides[0]
        return jnp.stack([state[1], force])

    @property
    def holding(self) -> Any:
        return jnp.stack([self.static, jnp.ones(())])


class Chain(SwitchedSystem):
    """Two masses on springs, each with dry friction on the ground."""

    friction: jax.Array = eqx.field(
        default=(0.5, 0.3), converter=lambda v: jnp.asarray(v, float)
    )
    pull: jax.Array = eqx.field(default=1.0, converter=jnp.asarray)

    def switching(self, t, state):
        return state[2:]

    def branch(self, t, state, sides):
        a, b, u, v = state
        spring = 4.0 * (b - a)
        force = jnp.stack([spring - a, self.pull * jnp.cos(1.3 * t) - spring])
        force = force - self.friction * sides
        return jnp.concatenate([jnp.stack([u, v]), force])


class Belt(SwitchedSystem):
    """A sprung block on a belt, with a preloaded stop that tears it off at once."""

    friction: jax.Array = eqx.field(default=1.0, converter=jnp.asarray)
    belt: jax.Array = eqx.field(default=0.5, converter=jnp.asarray)
    stop: jax.Array = eqx.field(default=0.3, converter=jnp.asarray)
    preload: jax.Array = eqx.field(default=2.0, converter=jnp.asarray)

    def switching(self, t, state):
        return jnp.stack([state[1] - self.belt, state[0] - self.stop])

    def branch(self, t, state, sides):
        beyond = self.preload + 50 * (state[0] - self.stop)
        pressed = jnp.where(sides[1] > 0, beyond, 0.0)
        force = -state[0] - pressed - self.friction * sides[0]
        return jnp.stack([state[1], force])


class Relay(SwitchedSystem):
    """A relay with hysteresis that kicks the state when it switches."""

    force: jax.Array = eqx.field(default=1.0, converter=jnp.asarray)
    kick: jax.Array = eqx.field(default=0.1, converter=jnp.asarray)

    def switching(self, t, state):
        return state[0]

    @property
    def hysteresis(self) -> Any:
        return 0.15

    def branch(self, t, state, sides):
        return jnp.stack([state[1], -self.force * sides[0] - 0.1 * state[1]])

    def reset(self, t, state, sides):
        return state.at[1].add(self.kick * sides[0])


class Timed(Relay):
    """A relay with kicks that depend on the time."""

    def reset(self, t, state, sides):
        return state.at[1].add(self.kick * sides[0] * (1 + 0.5 * jnp.sin(7 * t)))


CASES = {
    "stick-slip and a stop": (Cart(), (0.0107, -0.2), 1.1, ((110, 16), (880, 1))),
    "static friction": (
        Cart(static=jnp.asarray(1.4)),
        (0.0107, -0.2),
        1.1,
        ((110, 16), (880, 1)),
    ),
    "two bodies that stick": (
        Chain(),
        (0.4, -0.2, 0.3, 0.9),
        3.0,
        ((60, 16), (480, 1)),
    ),
    "an event that causes another": (Belt(), (0.0, 0.3), 1.0, ((100, 16), (800, 1))),
    "relay": (Relay(), (0.0, 0.7), 9.0, ((100, 16), (800, 1))),
    "kicks that depend on time": (Timed(), (0.0, 0.7), 9.0, ((100, 16), (800, 1))),
}


def end_of_piece(system, state, time, steps, substeps):
    """The state at the end of a piece of a fit."""
    count = jnp.zeros(steps)
    drive = DriveState(count, jnp.ones(steps), count)
    step = jnp.asarray(time / steps)
    return fly(Model(system, SENSORS), state, jnp.zeros(()), step, drive, substeps)[0]


@pytest.mark.parametrize("name", CASES)
def test_a_piece_meets_the_events_of_the_event_loop(name):
    """End of the motion with substeps to 1e-8; its derivatives by the state and by the
    parameters, with short steps, to 1e-6.
    """
    system, state, time, steps = CASES[name]
    values, rest = eqx.partition(system, eqx.is_inexact_array)
    point, shaped = ravel_pytree((values, jnp.asarray(state)))
    run = jaxcam.simulate(system, state, 0.0, time, settings=SHARP)
    assert run.switches.time.shape[0] >= 4

    @jax.jit
    @functools.partial(jax.jacfwd, has_aux=True)
    def every(point):
        values, x = shaped(point)
        here = eqx.combine(values, rest)
        found = [end_of_piece(here, x, time, n, s) for n, s in steps]
        found = (*found, flow(here, x, 0.0, time, settings=SHARP).state)
        return found, found

    (_, slopes, wanted), (coarse, _, expected) = every(point)
    assert np.max(np.abs(coarse - expected)) < 1e-8
    assert np.max(np.abs(slopes - wanted)) < 1e-6 * float(np.max(np.abs(wanted)))


def test_values_without_derivatives_are_the_same():
    """States, rates and end of a piece that sticks and slips, to 1e-13."""
    count = jnp.zeros(110)
    drive = DriveState(count, jnp.ones(110), count)
    state, step = jnp.array([0.0107, -0.2]), jnp.asarray(0.01)
    given = Model(Cart(), SENSORS), state, jnp.zeros(()), step, drive, 4
    both = jax.jit(lambda: (fly(*given), fly_without_derivatives(*given)))()
    for one, other in zip(*map(jax.tree.leaves, both), strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-13)


class Flicker(SwitchedSystem):
    """An oscillator whose stiffness changes at every zero of a fast cosine."""

    state_names = ("position", "velocity")
    stiffness: jax.Array = eqx.field(default=60.0, converter=jnp.asarray)
    rate: jax.Array = eqx.field(default=20.0, converter=jnp.asarray)

    def switching(self, t, state):
        return jnp.cos(self.rate * t)

    def branch(self, t, state, sides):
        force = -(self.stiffness + 5.0 * sides[0]) * state[0]
        return jnp.stack([state[1], force])


@pytest.mark.parametrize(("rate", "crowded"), [(20.0, False), (600.0, True)])
def test_more_events_in_a_piece_than_are_located_are_said(rate, crowded):
    """At most one switch in a piece of 50 ms, and nine or ten."""
    rng, start = np.random.default_rng(2), jnp.array([0.1, 0.0])
    run = record(Flicker(rate=rate), SENSORS, 2.0, rng=rng, state=start)
    model = Model(Flicker(rate=rate, stiffness=60.5), SENSORS)
    free = [Parameter("stiffness", lambda m: m.system.stiffness, tolerance=2.0)]
    found = fit(Problem.build(model, segment_by_model(model, [run]), free))
    doubts = [one.doubt for one in found.reasons]
    assert (Doubt.TOO_MANY_EVENTS in doubts) == crowded
    assert found.converged != crowded
    if crowded:
        assert "more than 8 switching events" in found.message


def test_events_in_data_without_weight_are_not_counted():
    """The fast switching begins after the part of the recording that is fitted."""

    class Late(Flicker):
        def switching(self, t, state):
            return jnp.cos(self.rate * jnp.maximum(t - 1.1, 0.0))

    rng, start = np.random.default_rng(2), jnp.array([0.1, 0.0])
    run = record(Late(rate=600.0), SENSORS, 2.0, rng=rng, state=start)
    model = Model(Late(rate=600.0, stiffness=60.5), SENSORS)
    free = [Parameter("stiffness", lambda m: m.system.stiffness, tolerance=2.0)]
    problem = Problem.build(model, segment_by_model(model, [run]), free)
    found = fit(problem, weights=problem.between(0.0, 1.0))
    assert found.converged


@pytest.fixture(scope="module")
def carts():
    """Two recordings of the cart, and a model of it."""
    rng = np.random.default_rng(1)
    runs = [
        record(Cart(), SENSORS, 4.0, rng=rng, state=jnp.array([0.0, v]), name=f"v{v}")
        for v in (0.3, -0.2)
    ]
    start = Cart(stiffness=61.0, friction=0.5, stop=0.0302, stop_stiffness=1800.0)
    return runs, Model(start, SENSORS)


def test_friction_and_stop_of_a_recorded_cart(carts):
    """Parameters of a fit, started up to 20 % off, within four standard errors."""
    runs, model = carts
    names = {"stiffness": 2.0, "friction": 0.3, "stop": 1e-3, "stop_stiffness": 400.0}
    free = [
        Parameter(name, lambda m, n=name: getattr(m.system, n), tolerance=tolerance)
        for name, tolerance in names.items()
    ]
    segments = segment_by_model(model, runs)
    found = fit(Problem.build(model, segments, free))
    assert found.converged
    for one in found.estimates:
        off = one.value - float(getattr(Cart(), one.name))
        assert abs(off) < 4 * one.stderr
        assert one.stderr < 1e-3 * one.value


def test_a_free_run_sticks_where_the_motion_does(carts):
    """Samples of a recording of four seconds with the true parameters, to the noise."""
    runs, model = carts
    found = free_run(Model(Cart(), SENSORS), runs[0], samples=40)
    assert found.rmse["position_m"] < 3 * 1e-5


class Block(SwitchedSystem):
    """A block that static friction holds for most of the time."""

    state_names = ("position", "velocity")
    friction: jax.Array = eqx.field(default=1.0, converter=jnp.asarray)

    def switching(self, t, state):
        return state[1]

    @property
    def holding(self) -> Any:
        return 1.4

    def branch(self, t, state, sides):
        force = 1.6 * jnp.cos(3.0 * t) - 4.0 * state[0] - self.friction * sides[0]
        return jnp.stack([state[1], force])


@pytest.mark.slow
def test_pieces_that_begin_while_static_friction_holds():
    """The load is above kinetic friction there; friction within four errors."""
    sensors, rng = {"position_m": Sensor(0, noise=1e-4)}, np.random.default_rng(0)
    start = jnp.array([0.1, 0.3])
    run = record(Block(), sensors, 8.0, rng=rng, state=start, interval=2e-3)
    model = Model(Block(friction=0.9), sensors)
    free = [Parameter("friction", lambda m: m.system.friction, tolerance=0.2)]
    found = fit(Problem.build(model, segment_by_model(model, [run]), free))
    (friction,) = found.estimates
    assert found.converged and friction.stderr < 1e-4
    assert abs(friction.value - 1.0) < 4 * friction.stderr


def test_a_drifting_drive_of_a_switched_system_is_refused_in_a_sentence():
    with pytest.raises(ValueError, match="does not support switching surfaces"):
        Wandering(Cart())
