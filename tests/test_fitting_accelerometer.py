"""Sensors of the rate of change of the state: accelerometers."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

import jaxcam
from jaxcam import HybridSystem
from jaxcam.fitting import (
    fit,
    free_run,
    Model,
    Output,
    Parameter,
    Problem,
    read_setup,
    residuals,
    segment_by_model,
    Sensor,
)
from jaxcam.hybrid import Wrapping
from jaxcam.models import BilinearOscillator, BouncingBall
from jaxcam.recordings import record, Recording, RigError


class Shaken(HybridSystem):
    """An oscillator with a stop in a shaken frame, in coordinates of the frame."""

    state_names = ("position", "velocity")
    stiffness: float = 400.0
    damping: float = 1.5
    amplitude: float = 3.0
    frequency: float = 27.0
    stop: float = 0.006
    restitution: float = 0.7

    def base(self, t):
        """The acceleration of the frame."""
        return self.amplitude * jnp.cos(self.frequency * t)

    def vector_field(self, t, state):
        x, v = state
        return jnp.stack([v, -self.stiffness * x - self.damping * v - self.base(t)])

    def gap(self, t, state):
        return self.stop - state[0]

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])

    def accelerometer(self, t, state, rate):
        """The absolute acceleration of the mass."""
        return rate[1] + self.base(t)


class Pushed(Wrapping):
    """A constant force added to a system."""

    inside: HybridSystem
    push: float = 2.0

    @property
    def inner(self):
        return self.inside

    def vector_field(self, t, state):
        return self.inside.vector_field(t, state) + jnp.stack([0.0, self.push])

    def gap(self, t, state):
        return self.inside.gap(t, state)

    def impact(self, t, state):
        return self.inside.impact(t, state)


RIG = Shaken()
SENSORS = {
    "position_m": Sensor(0, noise=2e-5),
    "acceleration_m_s2": Sensor(Output("accelerometer"), noise=0.002),
}
PARAMETERS = tuple(
    Parameter(name, lambda m, name=name: getattr(m.system, name), tolerance)
    for name, tolerance in (("stiffness", 20.0), ("damping", 0.5), ("stop", 2e-4))
)


@pytest.fixture(scope="module")
def run():
    rng = np.random.default_rng(5)
    return record(RIG, SENSORS, 2.0, rng=rng, state=[0.0, 0.1])


def _fitted(run, *channels):
    model = Model(RIG, {name: SENSORS[name] for name in channels})
    parts = segment_by_model(model, [run], PARAMETERS)
    return parts, fit(Problem.build(model, parts, PARAMETERS))


def test_an_output_contains_the_forces_of_a_wrapper():
    """The force that a diagnosis adds shows in an accelerometer of the inner system."""
    state, seen = jnp.array([1e-3, 0.2]), Output("accelerometer")
    alone, pushed = (float(seen(one, 0.4, state)) for one in (RIG, Pushed(RIG)))
    assert pushed - alone == pytest.approx(2.0, abs=1e-12)
    assert alone == pytest.approx(-400.0 * 1e-3 - 1.5 * 0.2, abs=1e-12)
    rate = float(Output(1)(RIG, 0.4, state))
    assert rate == pytest.approx(alone - 3.0 * np.cos(27 * 0.4), abs=1e-12)


def test_an_accelerometer_sharpens_a_fit(run):
    """All parameters within four standard errors, the cost per sample 1 (10 %); the
    damping is known better than from the position alone (less than half the error)."""
    _, position = _fitted(run, "position_m")
    parts, both = _fitted(run, *SENSORS)
    # although the other channel comes first in the alphabet
    assert parts[0].channel == "position_m"
    assert parts[0].impacts.count > 5
    assert both.converged, both.message
    for one in both.estimates:
        assert abs(one.value - getattr(RIG, one.name)) < 4 * one.stderr
    assert both.cost / both.problem.samples == pytest.approx(1.0, abs=0.1)
    assert both["damping"].stderr < 0.5 * position["damping"].stderr


def test_a_wrong_calibration_of_an_accelerometer_is_fitted(run):
    """Gain 1.05 and offset 0.3 m/s^2 within four standard errors."""
    channels = dict(run.channels)
    channels["acceleration_m_s2"] = 1.05 * run["acceleration_m_s2"] + 0.3
    wrong = Recording("wrong", run.time, channels)
    calibrated = tuple(
        Parameter(name, lambda m, name=name: getattr(m.sensors[_SEEN], name), 1.0)
        for name in ("gain", "offset")
    )
    model = Model(RIG, SENSORS)
    parts = segment_by_model(model, [wrong], PARAMETERS)
    found = fit(Problem.build(model, parts, (*PARAMETERS, *calibrated)))
    for name, true in (("gain", 1.05), ("offset", 0.3)):
        one = found[name]
        assert abs(one.value - true) < 4 * one.stderr < 0.2


_SEEN = "acceleration_m_s2"


def test_a_free_run_predicts_an_accelerometer():
    """The residuals of both channels are noise (rms within 15 %)."""
    free = Shaken(stop=1.0)
    run = record(free, SENSORS, 0.5, rng=np.random.default_rng(7), state=[0.0, 0.1])
    found = free_run(Model(free, SENSORS), run, samples=400)
    for name, sensor in SENSORS.items():
        off = found.residual(name)
        assert np.std(off[400:]) == pytest.approx(float(sensor.noise), rel=0.15)


def test_a_recorded_accelerometer_feels_the_floor():
    """A ball falls with -9.81 m/s^2 and rests on the floor with zero (1e-9)."""
    sensors = {"acceleration_m_s2": Sensor(Output(1), noise=1e-12)}
    run = record(
        BouncingBall(), sensors, 6.0, rng=np.random.default_rng(0), state=[1.0, 0.0]
    )
    seen = run["acceleration_m_s2"]
    np.testing.assert_allclose(seen[:100], -9.81, atol=1e-9)
    np.testing.assert_allclose(seen[-100:], 0.0, atol=1e-9)


RIG_FILE = """
system = "shaken.py:Shaken"
[parameters]
stiffness = {value = 400.0, tolerance = 20.0}
[channels.position_m]
sees = "position"
noise = 2e-5
[channels.acceleration_m_s2]
sees = "SEEN"
noise = 0.02
"""
CLASS = """
import jax.numpy as jnp
import jaxcam
class Shaken(jaxcam.HybridSystem):
    state_names = ("position", "velocity")
    stiffness: float = 400.0
    def vector_field(self, t, state):
        return jnp.stack([state[1], -self.stiffness * state[0]])
    def gap(self, t, state):
        return state[0] + 1.0
    def impact(self, t, state):
        return -state
    def accelerometer(self, t, state, rate):
        return rate[1] + 1.0
"""


@pytest.mark.parametrize(
    ("seen", "value"), [("rate of velocity", -4.0), ("accelerometer", -3.0)]
)
def test_a_rig_file_states_an_accelerometer(tmp_path, seen, value):
    (tmp_path / "shaken.py").write_text(CLASS)
    file = tmp_path / "rig.toml"
    file.write_text(RIG_FILE.replace("SEEN", seen))
    model = read_setup(file).model
    sensor, state = model.sensors["acceleration_m_s2"], jnp.array([0.01, 0.0])
    assert float(sensor.seen(model.system, 0.0, state)) == pytest.approx(value)


@pytest.mark.parametrize("seen", ["acceleration", "gap", "vector_field", "stiffness"])
def test_an_unknown_output_is_one_sentence(tmp_path, seen):
    (tmp_path / "shaken.py").write_text(CLASS)
    file = tmp_path / "rig.toml"
    file.write_text(RIG_FILE.replace("SEEN", seen))
    with pytest.raises(RigError, match="rate of velocity.*method"):
        read_setup(file)


def test_outputs_that_cannot_be_used_are_refused(run):
    only = Model(RIG, {_SEEN: SENSORS[_SEEN]})
    parts, _ = _fitted(run, "position_m")
    with pytest.raises(ValueError, match="add a sensor for a component"):
        Problem.build(only, parts, PARAMETERS)
    oscillator = BilinearOscillator()
    switched = Model(oscillator, {**SENSORS, _SEEN: Sensor(Output(1), noise=0.1)})
    with pytest.raises(ValueError, match="switching surfaces"):
        Problem.build(switched, parts, ())


def test_a_filter_passes_the_acceleration(run):
    """With a bandwidth of 200 Hz, the fitted stiffness is within four errors."""
    sensors = {
        "position_m": SENSORS["position_m"],
        _SEEN: Sensor(Output("accelerometer"), noise=0.002, bandwidth_hz=200.0),
    }
    rng = np.random.default_rng(6)
    filtered = record(RIG, sensors, 1.0, rng=rng, state=[0.0, 0.1])
    model = Model(RIG, sensors)
    parts = segment_by_model(model, [filtered], PARAMETERS)
    found = fit(Problem.build(model, parts, PARAMETERS))
    one = found["stiffness"]
    assert abs(one.value - 400.0) < 4 * one.stderr


def test_the_shock_of_an_impact_settles():
    """At each impact, a filter of 200 Hz jumps by its corner frequency times the change
    of the velocity (some 10^4 times the noise). With or without these shocks, all
    parameters are within four errors, and the residual is the noise to 5 %.
    """
    corner, noise = 2 * np.pi * 200.0, 0.002
    sensors = {
        "position_m": SENSORS["position_m"],
        _SEEN: Sensor(Output("accelerometer"), noise=noise, bandwidth_hz=200.0),
    }
    start = [0.0, 0.1]
    quiet = record(RIG, sensors, 1.0, rng=np.random.default_rng(6), state=start)
    motion = jaxcam.simulate(RIG, start, 0.0, 1.0)
    assert int(motion.impacts.count) > 2
    shaken = np.array(quiet[_SEEN])
    hits = motion.impacts
    for t, before, after in zip(hits.time, hits.before, hits.after, strict=True):
        since = quiet.time - float(t)
        tail = np.exp(-corner * np.maximum(since, 0.0)) * (since >= 0)
        shaken += corner * float(after[1] - before[1]) * tail
    channels = {**quiet.channels, _SEEN: shaken}
    model, found = Model(RIG, sensors), []
    for run in (quiet, dataclasses.replace(quiet, channels=channels)):
        parts = segment_by_model(model, [run], PARAMETERS)
        found.append(fit(Problem.build(model, parts, PARAMETERS)))
        assert found[-1].converged
        for one in found[-1].estimates:
            assert abs(one.value - getattr(RIG, one.name)) < 4 * one.stderr
        for part in residuals(found[-1]):
            assert part.rms == pytest.approx(part.noise, rel=0.05)
