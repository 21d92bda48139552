"""Errors of the sensor as free functions: what they are, and that they are found."""

import dataclasses
import math
from pathlib import Path
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest
from pendulum_records import COUNT, NOISE, records

from jaxcam.discrepancy import diagnose
from jaxcam.discrepancy._lagging import long_lag
from jaxcam.discrepancy.report import formula_of
from jaxcam.discrepancy.terms import (
    Family,
    FREE,
    more_faults,
    own_faults,
    terms_of,
    Variable,
    watched,
    Where,
    WithTerms,
)
from jaxcam.fitting import Model, Parameter, read_setup, Sensor
from jaxcam.fitting.engine import DriveState
from jaxcam.fitting.engine._fly import fly
from jaxcam.fitting.engine._predict import calibration, samples
from jaxcam.models import BouncingBall, ImpactOscillator
from jaxcam.recordings import Recording


RIG = Path(__file__).parents[1] / "docs" / "rigs" / "pendulum_wall.toml"
SINES = 20
ARGUMENTS = {
    Variable.POSITION: (-1.5, 0.0),
    Variable.VELOCITY: (-2.0, 2.0),
    Variable.PHASE: (0.0, 2 * math.pi),
    Variable.TIME: (0.0, 1.0),
}


def _family(argument):
    return Family(Where.SENSOR, argument, *ARGUMENTS[argument])


def _model(*terms) -> Model:
    system = WithTerms(ImpactOscillator(), terms)
    sensors = {"speed": Sensor(1, noise=1e-3), "place": Sensor(0, noise=1e-3)}
    return watched(Model(system, sensors))


def _seen(model: Model):
    """Both channels at samples of one piece of flight of 0.4 s, and when they are."""
    start, step, steps = 0.2, 0.1, 4
    place = jnp.tile(jnp.array([0.0, 0.3, 0.8]), (steps, 1))
    drive = DriveState(jnp.zeros(steps), jnp.zeros(steps), jnp.zeros(steps))
    _, nodes = fly(model, jnp.array([-1.0, 0.3]), start, step, drive)
    along = start + (jnp.arange(steps, dtype=float) + 0.5) * step, drive
    found = samples(model, nodes, calibration(model), start, step, place, along)
    time = start + step * (jnp.arange(steps, dtype=float)[:, None] + place)
    columns = np.asarray(found).reshape(-1, 2).T
    return dict(zip(model.sensors, columns)), np.asarray(time).ravel()


@pytest.mark.parametrize("argument", list(ARGUMENTS))
def test_the_sensor_of_the_first_coordinate_shows_the_function_besides(argument):
    """At every sample its value there; the other channel is as it was."""
    coefficients = 0.1 * np.random.default_rng(3).normal(size=SINES + 1)
    term = FREE[Where.SENSOR].of(_family(argument), "a", coefficients).prepared()
    bare, time = _seen(_model())
    shown, _ = _seen(_model(term))
    turned = ImpactOscillator().period
    at = {
        Variable.POSITION: bare["place"],
        Variable.VELOCITY: bare["speed"],
        Variable.PHASE: 2 * np.pi * time / np.asarray(turned),
        Variable.TIME: time,
    }[argument]
    expected = np.array([float(term.at(x)) for x in at])
    np.testing.assert_array_equal(shown["speed"], bare["speed"])
    assert np.max(np.abs(expected)) > 0.05
    # the velocity between two nodes is that of a cubic, to 1e-4
    np.testing.assert_allclose(shown["place"] - bare["place"], expected, atol=2e-3)


def test_a_sensor_is_as_it_was_without_such_a_term():
    model = _model()
    assert all(sensor.error is None for sensor in model.sensors.values())


def test_a_fault_of_the_sensor_moves_nothing():
    coefficients = np.ones(SINES + 1)
    term = FREE[Where.SENSOR].of(_family(Variable.POSITION), "a", coefficients)
    state = jnp.array([-0.7, 0.2])
    bare, with_it = (WithTerms(ImpactOscillator(), t) for t in ((), (term,)))
    for name in ("vector_field", "gap", "impact"):
        one, other = (getattr(s, name)(0.3, state) for s in (bare, with_it))
        np.testing.assert_array_equal(one, other)


def test_gain_offset_and_lag_of_that_sensor_are_known():
    parameters = [
        Parameter("place_gain", lambda m: m.sensors["place"].gain),
        Parameter("late", lambda m: m.sensors["place"].lag),
        Parameter("zero", lambda m: m.sensors["speed"].offset),
        Parameter("first", lambda m: terms_of(m)[0].numbers()[0]),
    ]
    term = FREE[Where.SENSOR].of(_family(Variable.TIME), "a", np.zeros(SINES + 1))
    model = _model(term)
    assert own_faults(model, parameters) == ["place_gain", "late"]
    (more,) = more_faults(model, parameters)
    assert more.where(model) is model.sensors["place"].offset


def test_what_a_gain_can_do_is_no_form():
    for argument in (Variable.POSITION, Variable.VELOCITY):
        names = {one.name for one in _family(argument).primitives}
        assert "straight" not in names and "wave" in names
    names = {one.name for one in _family(Variable.TIME).primitives}
    assert "straight" in names


def test_an_error_by_position_is_said_to_be_one_of_the_scale():
    family = _family(Variable.POSITION)
    wave = next(one for one in family.primitives if one.name == "wave")
    text, words = formula_of(family, wave, np.array([1e-3, 2.0, 0.5]), "sensor")
    assert text.startswith("0.001*cos(")
    assert words.startswith("a sensor error that oscillates")
    assert "eccentric encoder" in words


def _nothing(time, turned, position):
    return 0 * position


def _by_position(time, turned, position):
    return 8e-4 * np.sin(2 * np.pi * (position + 0.15) / 0.3)


def _by_phase(time, turned, position):
    return 6e-4 * np.cos(turned - 1.0)


def _by_time(time, turned, position):
    return 1.5e-3 * (time / 4.0) ** 2


def _diagnosed(error):
    return diagnose(read_setup(RIG), records(error))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "argument"),
    [(_by_position, "position"), (_by_phase, "phase"), (_by_time, "time")],
)
def test_what_is_wrong_with_a_sensor_is_found(error, argument):
    """Kind, argument, nine tenths of the unseen squared error above the noise, and the
    curve within 0.4 of its rms, apart from a constant and what is in proportion."""
    found = _diagnosed(error)
    (one,) = found.missing
    assert (one.kind, one.arguments) == ("sensor", (argument,))
    floor = found.noise_floor**2
    above = found.heldout_before**2 - floor
    assert found.heldout_after**2 - floor < 0.1 * above
    along = one.grid[0]
    none = np.zeros_like(along)
    places = {"position": none, "phase": none, "time": none} | {argument: along}
    true = error(places["time"], places["phase"], places["position"])
    known = [np.ones_like(along)]
    if argument == "position":
        known.append(along)
    basis, _ = np.linalg.qr(np.stack(known, axis=1))
    true, value = (x - basis @ (basis.T @ x) for x in (true, one.value))
    assert np.sqrt(np.mean((value - true) ** 2)) < 0.4 * np.sqrt(np.mean(true**2))
    assert not isinstance(found.system(), WithTerms)
    assert any(sensor.error is not None for sensor in found.model().sensors.values())


@pytest.mark.slow
def test_a_sensor_that_is_right_lacks_nothing():
    found = _diagnosed(_nothing)
    assert found.verdict == "none" and not found.missing
    assert found.noise_floor == pytest.approx(math.hypot(NOISE, COUNT / 12**0.5))


def test_only_a_lag_of_two_samples_is_removed(unchecked_types):
    """The expansion in powers of the lag is accurate up to one and a half samples."""
    run = Recording("run", 1e-3 * np.arange(9), {"angle_rad": np.zeros(9)})
    sensors = {"angle_rad": Sensor(0, noise=1e-3)}
    model = Model(WithTerms(BouncingBall(), ()), sensors)

    def found(lag: float | None):
        effect = SimpleNamespace(
            name="sensor_lag" if lag else "quadratic_drag",
            parameters={"lag": SimpleNamespace(value=lag)},
        )
        problem = SimpleNamespace(model=model)
        return SimpleNamespace(
            effects=(effect,), after=SimpleNamespace(problem=problem)
        )

    assert long_lag(found(2.1e-3), [run]) == {"angle_rad": 2.1e-3}
    coarser = dataclasses.replace(run, time=2 * run.time)
    assert long_lag(found(2.1e-3), [run, coarser]) == {}
    assert long_lag(found(1.4e-3), [run]) == {}
    assert long_lag(found(None), [run]) == {}
