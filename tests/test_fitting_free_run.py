"""A whole recording from its first samples and its input alone."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.fitting import (
    fit_free_run,
    free_run,
    Input,
    Model,
    Parameter,
    Sensor,
    Turning,
)
from jaxcam.hybrid import SwitchedSystem
from jaxcam.recordings import Recording, RecordingError


INTERVAL = 2e-3


class Cart(HybridSystem):
    """A mass with viscous friction, pushed by a force that was measured."""

    inverse_mass: float = 1.0
    viscous: float = 0.5
    dry: float = 0.0
    wall: float = 100.0
    force: float = 0.0

    def vector_field(self, t, state):
        push = self.inverse_mass * self.force - self.viscous * state[1]
        return jnp.stack([state[1], push - self.dry * jnp.tanh(state[1] / 0.01)])

    def gap(self, t, state):
        return self.wall + state[0]

    def impact(self, t, state):
        return state


PARAMETERS = [
    Parameter("1/mass", lambda m: m.system.inverse_mass, lower=0.0),
    Parameter("viscous", lambda m: m.system.viscous, lower=0.0),
]


def _force(system):
    return system.force


def carted(force, x=0.0, v=0.0, b=1.0, c=0.5):
    """Position of a cart under a held force, exact from sample to sample."""
    found = []
    decay = np.exp(-c * INTERVAL)
    reach = (1 - decay) / c
    for level in force:
        found.append(x)
        end = b * level / c
        x, v = x + end * INTERVAL + (v - end) * reach, end + (v - end) * decay
    return np.array(found)


def pushed(seed: int, count: int = 3000):
    """A force that jumps at every fiftieth sample."""
    rng = np.random.default_rng(seed)
    return np.repeat(rng.normal(size=count // 50), 50)


def recorded(position, force, name="run") -> Recording:
    time = INTERVAL * np.arange(len(position))
    return Recording(name, time, {"position_m": position, "force_N": force})


def model(noise: float = 1e-6, **values) -> Model:
    sensor = Sensor(0, noise=noise)
    return Model(Cart(**values), {"position_m": sensor}, Input("force_N", _force))


def test_the_true_model_leaves_nothing():
    force = pushed(0)
    run = recorded(carted(force, 0.3, -0.2), force)
    found = free_run(model(), run)
    assert found.state == pytest.approx([0.3, -0.2], abs=1e-8)
    # six metres of motion
    assert found.rmse["position_m"] < 1e-7
    assert found.samples == 20
    assert found.simulated["position_m"].shape == (3000,)


def test_noise_of_the_first_samples_is_all_that_adds_up():
    force, noise = pushed(1), 1e-5
    clean = carted(force, 0.3, -0.2)
    rng = np.random.default_rng(5)
    run = recorded(clean + noise * rng.standard_normal(3000), force)
    found = free_run(model(noise), run, samples=200)
    drift = found.simulated["position_m"] - clean
    # standard errors of a straight line through 200 samples at its start
    place = noise * np.sqrt(4 / 200)
    speed = noise * np.sqrt(12 / 200) / (200 * INTERVAL)
    assert abs(drift[0]) < 4 * place
    # a wrong speed goes on for no more than its time constant
    assert np.max(np.abs(drift)) < 4 * (place + speed / 0.5)


def test_a_wrong_parameter_shows_by_as_much_as_it_moves_the_end():
    force = pushed(2)
    run = recorded(carted(force), force)
    found = free_run(model(inverse_mass=1.01), run)
    # the initial state makes up for what little it can
    assert found.state == pytest.approx([0.0, 0.0], abs=1e-3)
    right, wrong = carted(force), carted(force, *found.state, b=1.01)
    expected = np.sqrt(np.mean((wrong - right)[20:] ** 2))
    assert found.rmse["position_m"] == pytest.approx(expected, rel=1e-6)
    assert expected > 1e-4


def test_a_sensor_of_another_gain_and_zero_is_seen_through():
    force = pushed(3)
    run = recorded(2.0 + 5.0 * carted(force, 0.1, 0.2), force)
    sensor = Sensor(0, noise=1e-6, gain=5.0, offset=2.0)
    found = free_run(
        Model(Cart(), {"position_m": sensor}, Input("force_N", _force)), run
    )
    assert found.state == pytest.approx([0.1, 0.2], abs=1e-8)
    assert found.rmse["position_m"] < 1e-6


def test_an_input_between_whose_samples_a_line_is_drawn():
    """To the integration error: the exact motion under a force with corners at the
    samples. Held, the force would be late by half an interval."""
    force = np.sin(0.02 * np.arange(1000))
    b, c = Cart().inverse_mass, Cart().viscous
    x, v, position = 0.1, 0.2, []
    for level, slope in zip(force, np.append(np.diff(force), 0.0) / INTERVAL):
        position.append(x)
        # v' = b (level + slope s) - c v
        base, rise = b * (level - slope / c) / c, b * slope / c
        reach = (1 - np.exp(-c * INTERVAL)) / c
        x = x + base * INTERVAL + rise * INTERVAL**2 / 2 + (v - base) * reach
        v = base + rise * INTERVAL + (v - base) * np.exp(-c * INTERVAL)
    run = recorded(np.array(position), force)
    linear = Input("force_N", _force, "linear")
    found = free_run(dataclasses.replace(model(), drive=linear), run)
    assert found.rmse["position_m"] < 1e-8
    assert free_run(model(), run).rmse["position_m"] > 1e-5


def test_lost_samples_do_not_count():
    force = pushed(4)
    position = carted(force, 0.1, 0.2)
    position[[3, 11, 500]] = np.nan
    found = free_run(model(), recorded(position, force))
    assert found.rmse["position_m"] < 1e-7


def test_what_cannot_be_run_is_refused():
    force = -np.abs(pushed(6))
    run = recorded(carted(force), force)
    with pytest.raises(ValueError, match="meets a constraint"):
        free_run(model(wall=0.01), run)
    with pytest.raises(RecordingError, match="between 2 and 3000"):
        free_run(model(), run, samples=3000)
    turned = Model(
        Cart(), {"position_m": Sensor(0, noise=1.0)}, Turning(_force, _force)
    )
    with pytest.raises(ValueError, match="rotating drive"):
        free_run(turned, run)
    with pytest.raises(RecordingError, match="no channel `force_N`"):
        free_run(model(), Recording("bare", run.time, {"position_m": force}))
    clock = run.time + 0.4 * INTERVAL * (np.arange(3000) % 2)
    with pytest.raises(RecordingError, match="not evenly spaced"):
        free_run(model(), Recording("uneven", clock, run.channels))


def test_a_fit_by_free_runs_finds_the_truth():
    runs = []
    for seed in (8, 9):
        force = pushed(seed)
        runs.append(recorded(carted(force, 0.1, 0.3), force, f"run{seed}"))
    told = []
    found = fit_free_run(
        model(inverse_mass=0.8, viscous=0.9),
        runs,
        PARAMETERS,
        progress=lambda number, cost: told.append((number, cost)),
    )
    assert found.converged
    assert [number for number, _ in told] == list(range(1, len(told) + 1))
    assert told[-1][1] < 1e-6 * told[0][1]
    assert found.values["1/mass"] == pytest.approx(1.0, rel=1e-7)
    assert found.values["viscous"] == pytest.approx(0.5, rel=1e-6)
    assert [run.rmse["position_m"] < 1e-6 for run in found.runs] == [True, True]


def test_a_fit_by_free_runs_is_the_one_that_free_runs_judge_best():
    """Where physics is missing, the parameters are those that stray least."""
    force = 3 * pushed(7)
    blank = recorded(np.zeros(3000), force)
    position = free_run(model(dry=0.3), blank).simulated["position_m"]
    run = recorded(position, force)
    found = fit_free_run(model(), [run], PARAMETERS)
    error = found.runs[0].rmse["position_m"]

    def at(inverse_mass, viscous):
        moved = model(inverse_mass=inverse_mass, viscous=viscous)
        return free_run(moved, run).rmse["position_m"]

    best = list(found.values.values())
    assert error < 0.5 * at(1.0, 0.5)
    for k in range(2):
        for factor in (0.98, 1.02):
            other = list(best)
            other[k] *= factor
            assert at(*other) > error


def test_bounds_hold():
    force = pushed(10)
    run = recorded(carted(force), force)
    bounded = [PARAMETERS[0], dataclasses.replace(PARAMETERS[1], lower=0.7)]
    found = fit_free_run(model(viscous=0.9), [run], bounded)
    assert found.values["viscous"] == pytest.approx(0.7, abs=1e-3)


class Rattle(SwitchedSystem):
    """An oscillator of 20 rad/s whose spring is a little stiffer on one side."""

    state_names = ("position", "velocity")

    def switching(self, t, state):
        return state[0]

    def branch(self, t, state, sides):
        stiffness = jnp.where(sides[0] > 0, 420.0, 400.0)
        return jnp.stack([state[1], -stiffness * state[0]])


def _rattling(interval: float):
    """A free run of the motion from rest at 0.1, and the exact solution."""
    time = interval * np.arange(40)
    fast, slow = np.sqrt(420.0), 20.0
    half, other = np.pi / fast, np.pi / slow
    since = (time + half / 2) % (half + other)
    speed = 0.1 * fast
    position = np.where(
        since < half,
        speed / fast * np.sin(fast * since),
        -speed / slow * np.sin(slow * (since - half)),
    )
    run = Recording("rattle", time, {"position_m": position})
    model = Model(Rattle(), {"position_m": Sensor(0, noise=1e-5)})
    return free_run(model, run, samples=10).residual("position_m")


def test_switching_events_between_two_samples_are_located():
    """To 1e-5 of the amplitude in 40 samples, in long intervals to 2e-3."""
    assert np.max(np.abs(_rattling(0.02))) < 1e-6
    assert np.max(np.abs(_rattling(0.1))) < 1e-6
    # with two or three events between two samples, the steps are as short as possible
    assert np.max(np.abs(_rattling(0.44))) < 2e-4


def test_a_free_run_that_switches_too_often_says_so():
    with pytest.raises(
        ValueError, match="at least 4 switching events between the sample at"
    ):
        _rattling(0.48)


def test_a_free_run_of_a_motion_far_too_fast_for_its_samples_says_so():
    with pytest.raises(ValueError, match="64 integration steps between two samples"):
        _rattling(0.9)
