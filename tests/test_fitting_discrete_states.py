"""Fits of systems whose mode, or side of a surface, depends on the past."""

import functools
import itertools
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from jax.flatten_util import ravel_pytree

import jaxcam
from jaxcam.discrepancy import diagnose, Verdict
from jaxcam.fitting import (
    Doubt,
    fit,
    free_run,
    held_out_cost,
    Model,
    Parameter,
    Problem,
    segment_by_model,
    Sensor,
)
from jaxcam.fitting.engine._discrete_states import most_likely
from jaxcam.fitting.engine._fly import fly
from jaxcam.fitting.engine._late_switch import follower, JUMP
from jaxcam.fitting.engine._model import DriveState
from jaxcam.fitting.engine._pieces import FLIGHT, FREE, IMPACT
from jaxcam.hybrid import flow, HybridAutomaton, Settings, SwitchedSystem
from jaxcam.recordings import record


SENSORS = {"position_m": Sensor(0, noise=1e-3)}


def number(default: float):
    return eqx.field(default=default, converter=lambda v: jnp.asarray(v, float))


class Relay(SwitchedSystem):
    """A damped mass that a relay with hysteresis pushes to and fro."""

    state_names = ("position", "velocity")
    force: Any = number(1.0)
    threshold: Any = number(0.15)
    damping: Any = number(0.3)

    def switching(self, t, state):
        return state[0]

    @property
    def hysteresis(self) -> Any:
        return self.threshold

    def branch(self, t, state, sides):
        push = -self.force * sides[0] - self.damping * state[1]
        return jnp.stack([state[1], push])


class Dragged(Relay):
    """The relay in air."""

    drag: Any = number(0.15)

    def branch(self, t, state, sides):
        drag = -self.drag * state[1] * jnp.abs(state[1])
        return super().branch(t, state, sides) + jnp.stack([jnp.zeros(()), drag])


class Belt(HybridAutomaton):
    """A sprung block that sticks to a belt until the spring exceeds the grip."""

    modes = ("sticking", "slipping back")
    transitions = (("sticking", "slipping back"), ("slipping back", "sticking"))
    state_names = ("position", "velocity")
    grip: Any = number(1.0)
    kinetic: Any = number(0.6)
    stiffness: Any = number(1.0)
    belt: Any = number(0.5)

    def fields(self, t, state, sides):
        slipping = self.kinetic - self.stiffness * state[0]
        rates = jnp.stack([jnp.zeros(()), slipping])
        return jnp.stack([jnp.broadcast_to(state[1], (2,)), rates], axis=1)

    def guards(self, t, state):
        left = self.grip - self.stiffness * state[0]
        return jnp.stack([left, self.belt - state[1]])


class Latch(HybridAutomaton):
    """A ball above a floor, held back by a brake that latches above a height."""

    modes = ("free", "braked")
    transitions = (("free", "braked"), ("braked", "free"))
    state_names = ("height", "velocity")
    gravity: Any = number(9.81)
    brake: Any = number(4.0)
    high: Any = number(0.5)
    low: Any = number(0.2)
    restitution: Any = number(0.95)

    def fields(self, t, state, sides):
        rates = jnp.stack([-self.gravity, self.brake - self.gravity])
        return jnp.stack([jnp.broadcast_to(state[1], (2,)), rates], axis=1)

    def guards(self, t, state):
        return jnp.stack([self.high - state[0], state[0] - self.low])

    def gap(self, t, state):
        return state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])


class Cascade(HybridAutomaton):
    """Three modes; the second one ends as soon as it begins, if its guard is negative
    then.
    """

    modes = ("first", "second", "third")
    transitions = (("first", "second"), ("second", "third"))

    def fields(self, t, state, sides):
        rates = jnp.array([-1.0, 5.0, -2.0])
        return jnp.stack([jnp.broadcast_to(state[1], (3,)), rates], axis=1)

    def guards(self, t, state):
        return jnp.stack([state[0], state[1] + 0.1])


class Listed(HybridAutomaton):
    """Three modes whose transitions are listed in either order."""

    modes = ("a", "b", "c")
    transitions = (("a", "c"), ("b", "a"), ("a", "b"))

    def fields(self, t, state, sides):
        rates = jnp.array([-1.0, 5.0, -2.0])
        return jnp.stack([jnp.broadcast_to(state[1], (3,)), rates], axis=1)

    def guards(self, t, state):
        found = {
            ("a", "c"): state[0],
            ("b", "a"): state[0] + 0.2,
            ("a", "b"): state[1] + 9.0,
        }
        return jnp.stack([found[one] for one in self.transitions])


class Reordered(Listed):
    transitions = (("b", "a"), ("a", "c"), ("a", "b"))


CASES = {
    "relay": (Relay, [(0.0, 0.7), (0.1, -0.3)], 12.0, 5e-3, 1e-3),
    "stick-slip": (Belt, [(0.0, 0.5), (0.6, -0.4)], 16.0, 5e-3, 1e-3),
    "latch with impacts": (Latch, [(0.9, 0.0), (0.7, 0.5)], 3.0, 2e-3, 5e-4),
}
TOLERANCES = {
    "force": 0.3,
    "threshold": 0.05,
    "damping": 0.2,
    "grip": 0.3,
    "kinetic": 0.2,
    "stiffness": 0.3,
    "belt": 0.1,
    "gravity": 1.0,
    "brake": 2.0,
    "high": 0.1,
    "low": 0.1,
    "restitution": 0.1,
}
STARTS: dict[str, dict[str, float]] = {
    "relay": dict(force=1.1, threshold=0.13, damping=0.25),
    "stick-slip": dict(grip=1.09, kinetic=0.65, stiffness=1.07, belt=0.47),
    "latch with impacts": dict(
        gravity=9.2, brake=4.4, high=0.52, low=0.19, restitution=0.93
    ),
}


def recorded(name, seed=0):
    kind, states, time, interval, noise = CASES[name]
    rng, sensors = np.random.default_rng(seed), {"position_m": Sensor(0, noise=noise)}
    runs = [
        record(
            kind(),
            sensors,
            time,
            rng=rng,
            state=jnp.array(state),
            interval=interval,
            name=f"run{k}",
        )
        for k, state in enumerate(states)
    ]
    return runs, sensors


def free(*names):
    return [
        Parameter(name, lambda m, n=name: getattr(m.system, n), TOLERANCES[name])
        for name in names
    ]


@pytest.mark.parametrize("name", CASES)
def test_parameters_of_a_recorded_system_with_memory(name):
    """Started up to 17 % off: within four standard errors, which are below 1 %."""
    kind, start = CASES[name][0], STARTS[name]
    runs, sensors = recorded(name)
    model, parameters = Model(kind(**start), sensors), free(*start)
    segments = segment_by_model(model, runs, parameters)
    found = fit(Problem.build(model, segments, parameters))
    assert found.converged, found.message
    for one in found.estimates:
        truth = float(getattr(kind(), one.name))
        assert abs(one.value - truth) < 4 * one.stderr, one
        assert one.stderr < 0.01 * truth


SHARP = Settings(tolerance=1e-12)


@pytest.mark.parametrize(
    ("system", "state", "time"),
    [
        (Belt(), (0.7, 0.5), 6.0),
        (Relay(), (0.0, 0.7), 9.0),
    ],
)
def test_a_piece_meets_the_transitions_of_the_event_loop(system, state, time):
    """End of the motion to 1e-8; its derivatives by the state and by the parameters, to
    1e-6.
    """
    values, rest = eqx.partition(system, eqx.is_inexact_array)
    point, shaped = ravel_pytree((values, jnp.asarray(state)))
    run = jaxcam.simulate(system, state, 0.0, time, settings=SHARP)
    assert run.switches is not None and run.switches.time.shape[0] >= 1

    @jax.jit
    @functools.partial(jax.jacfwd, has_aux=True)
    def both(point):
        values, x = shaped(point)
        here = eqx.combine(values, rest)
        count = jnp.zeros(800)
        drive = DriveState(count, jnp.ones(800), count)
        piece = x, jnp.zeros(()), jnp.asarray(time / 800), drive
        ends = fly(Model(here, SENSORS), *piece)[0]
        found = ends, flow(here, x, 0.0, time, settings=SHARP).state
        return found, found

    (slopes, wanted), (end, expected) = both(point)
    assert np.max(np.abs(end - expected)) < 1e-8
    assert np.max(np.abs(slopes - wanted)) < 1e-6 * float(np.max(np.abs(wanted)))


@given(st.integers(0, 10_000))
@settings(max_examples=30, deadline=None)
def test_the_most_likely_sequence_is_that_of_an_enumeration(seed):
    """Total cost of five pieces with three discrete states, to 1e-9."""
    rng, pieces, states = np.random.default_rng(seed), 5, 3
    costs = rng.uniform(0.0, 60.0, (pieces, states))
    follows = rng.random((pieces, states, states)) < 0.4
    joint = rng.choice([FREE, FLIGHT, IMPACT], pieces)
    stated = int(rng.integers(states))

    def total(sequence):
        cost = JUMP if sequence[0] != stated else 0.0
        for k, state in enumerate(sequence):
            cost += costs[k, state]
            if k and joint[k] != FREE and not follows[k - 1, sequence[k - 1], state]:
                cost += JUMP
        return cost

    arrays = (jnp.asarray(a) for a in (costs, follows, stated, joint))
    found = np.asarray(most_likely(*arrays))
    least = min(total(s) for s in itertools.product(range(states), repeat=pieces))
    assert abs(total(found) - least) < 1e-9


def test_a_late_switch_continues_the_motion_smoothly():
    """A switch before the end of a piece or after it: the state in which the next
    piece begins, in the mode after the switch, is the same function of the threshold;
    second differences are those of a smooth function.
    """
    reach, step = jnp.asarray(0.1), jnp.asarray(0.05)
    count = jnp.zeros(10)
    drive, stop = DriveState(count, jnp.ones(10), count), jnp.asarray(0.5)

    @jax.jit
    @jax.vmap
    def begins(threshold):
        model = Model(Relay(threshold=threshold, force=2.0), SENSORS)
        end = fly(model, jnp.array([0.0, -0.5]), jnp.zeros(()), step, drive)[0]
        crossed = (end[0] < -threshold).astype(int)
        given = model, model.system, stop, end, crossed, jnp.asarray(1), reach
        return (*follower(*given, jnp.ones(2)), crossed)

    thresholds = jnp.linspace(0.45, 0.48, 61)
    states, missing, crossed = map(np.asarray, begins(thresholds))
    assert 10 < np.sum(crossed) < 50
    assert np.all(missing == 0)
    bends = np.diff(states, 2, axis=0)
    # the kink without continuation would be 5e-4 times the change of acceleration
    assert np.max(np.abs(bends)) < 2e-5


def test_a_switch_far_from_the_end_is_missed_by_its_distance():
    """0.1 m above the threshold, with an error of 1 mm of the position: 100 errors, at
    which the residual begins to grow like the square root.
    """
    model, none = Model(Relay(), SENSORS), jnp.zeros(())
    given = model, model.system, none, jnp.array([-0.05, 0.0])
    before, after = jnp.asarray(0), jnp.asarray(1)
    error = jnp.array([1e-3, 1.0])
    found = follower(*given, before, after, jnp.asarray(1e-6), error)
    np.testing.assert_allclose(found.missing, 100.0 / 2**0.25, rtol=1e-4)


@pytest.mark.parametrize("system", [Listed(), Reordered()])
def test_only_a_transition_of_the_present_mode_is_missed(system):
    """From the second mode to the first, 50 errors away, whichever transitions of
    other modes are listed before it.
    """
    model, none = Model(system, SENSORS), jnp.zeros(())
    given = model, model.system, none, jnp.array([-0.15, 0.0])
    error = jnp.array([1e-3, 1.0])
    modes = jnp.asarray(1), jnp.asarray(0)
    found = follower(*given, *modes, jnp.asarray(1e-6), error)
    np.testing.assert_allclose(found.missing, 50.0 / 1.25**0.25, rtol=1e-3)


def test_held_out_recordings_begin_in_the_modes_that_they_show():
    """Cost of a recording of 2400 samples that did not take part in the fit: below
    1.1 per sample, although the fit started from a threshold of 0.11 m instead of
    0.15 m.
    """
    runs, sensors = recorded("relay")
    model = Model(Relay(force=1.1, threshold=0.11, damping=0.25), sensors)
    parameters = free("force", "threshold", "damping")
    segments = segment_by_model(model, runs, parameters)
    problem = Problem.build(model, segments, parameters)
    found = fit(problem, weights=problem.only([problem.records[0]]))
    other = problem.only([problem.records[1]])
    assert held_out_cost(problem, found, other) < 1.1 * len(runs[1])


def test_a_switch_that_the_model_lacks_is_said():
    """The model never latches, because its upper height is out of reach."""
    runs, sensors = recorded("latch with impacts")
    model = Model(Latch(high=3.0), sensors)
    parameters = free("gravity", "brake", "restitution")
    segments = segment_by_model(model, runs, parameters)
    found = fit(Problem.build(model, segments, parameters))
    doubts = {one.doubt: one.sentence for one in found.reasons}
    assert not found.converged
    sentence = doubts[Doubt.UNEXPLAINED_SWITCH]
    assert "changes where the model does not switch, first in run0" in sentence


def test_a_free_run_begins_in_the_mode_that_the_samples_show():
    """Samples of ten seconds, to the noise; the recording begins between the thresholds
    on the side on which the system would not start.
    """
    (run, *_), sensors = recorded("relay")
    system, position = Relay(), run["position_m"]
    inside = np.abs(position) < 0.1
    rising = np.append(np.diff(position) > 0, False)
    # on the way back from the negative side, the relay pulls to the positive one
    start = run.time[
        np.flatnonzero(inside & rising & (position > 0.02) & (run.time > 2))
    ]
    rest = run.between(float(start[0]), float(run.time[-1]))
    found = free_run(Model(system, sensors), rest, samples=60)
    assert found.rmse["position_m"] < 4e-3


class Many(Relay):
    """A relay with five surfaces."""

    def switching(self, t, state):
        return jnp.broadcast_to(state[0], (5,))


def test_too_many_discrete_states_are_refused_in_a_sentence():
    runs, sensors = recorded("relay")
    model = Model(Many(), sensors)
    with pytest.raises(ValueError, match="Many has 32 discrete states"):
        Problem.build(model, segment_by_model(model, runs), free("force"))


@pytest.mark.slow
def test_a_diagnosis_of_a_relay():
    """Quadratic drag is missing: within four standard errors."""
    rng = np.random.default_rng(5)
    states = (0.0, 0.7), (0.1, -0.3), (0.0, 1.2)
    runs = [
        record(
            Dragged(),
            SENSORS,
            12.0,
            rng=rng,
            state=jnp.array(state),
            interval=5e-3,
            name=f"run{k}",
        )
        for k, state in enumerate(states)
    ]
    system = Relay(force=1.05, threshold=0.145, damping=0.28)
    parameters = free("force", "threshold", "damping")
    segments = segment_by_model(Model(system, SENSORS), runs, parameters)
    found = diagnose(system, segments, sensors=SENSORS, parameters=parameters)
    assert found.verdict is Verdict.EFFECT
    (effect,) = found.effects
    (drag,) = effect.parameters.values()
    assert effect.name == "quadratic_drag"
    assert abs(drag.value - 0.15) < 4 * drag.stderr
