"""Long lags of sensors: removed from recordings by whole samples, and fitted."""

import math
import textwrap

import numpy as np
import pytest

from jaxcam import fitting
from jaxcam.data import NEW_RIG
from jaxcam.discrepancy import Policy
from jaxcam.discrepancy.search import segmented, setup_question
from jaxcam.fitting import Sensor, without_lags
from jaxcam.models import ImpactOscillator
from jaxcam.recordings import Recording, RecordingError, RigError


RIG = """
    system = "swing.py:Swing"

    [parameters]
    stiffness = {value = 40.0, tolerance = 2.0, unit = "1/s^2"}
    drive = 20.0

    [channels.position_m]
    sees = "position"
    noise = 1e-5
    lag = {value = 0.018, tolerance = 0.01}
    gain = {value = 1.0, tolerance = 0.05}
    offset = 0.5e-3
"""
SYSTEM = """
    import jax.numpy as jnp
    import jaxcam


    class Swing(jaxcam.HybridSystem):
        state_names = ("position", "velocity")
        stiffness: float = 40.0
        drive: float = 20.0

        def vector_field(self, t, state):
            push = 3.0 * jnp.cos(self.drive * t)
            return jnp.stack([state[1], push - self.stiffness * state[0]])

        def gap(self, t, state):
            return jnp.zeros(0)

        def impact(self, t, state):
            return jnp.zeros((0, 2))

        @property
        def period(self):
            return 2 * jnp.pi / self.drive
"""
STIFFNESS, LAG, GAIN = 41.0, 0.0213, 1.02


def recorded(seed: int) -> Recording:
    """A free and a forced oscillation in closed form, seen late."""
    rng = np.random.default_rng(seed)
    time = 1e-3 * np.arange(2000)
    late = time - LAG
    size = 3.0 / (STIFFNESS - 20.0**2)
    free = 0.02 * np.cos(math.sqrt(STIFFNESS) * late + seed)
    seen = 0.5e-3 + GAIN * (free + size * np.cos(20.0 * late))
    noisy = seen + 1e-5 * rng.standard_normal(len(time))
    return Recording(f"run{seed}", time, {"position_m": noisy})


@pytest.fixture(scope="module")
def setup_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("swing")
    (folder / "swing.py").write_text(textwrap.dedent(SYSTEM))
    (folder / "rig.toml").write_text(textwrap.dedent(RIG))
    return folder / "rig.toml"


@pytest.fixture(scope="module")
def setup(setup_file):
    return fitting.read_setup(setup_file)


def test_a_long_lag_is_fitted_exactly(setup):
    """A lag of 21.3 samples, 0.43 rad of the forcing: an expansion to second order
    would be wrong by 1e-3 m, a hundred times the noise.
    """
    found = fitting.fit(setup.problem([recorded(1), recorded(2)]))
    truth = {"stiffness": STIFFNESS, "position_m.lag": LAG, "position_m.gain": GAIN}
    assert found.converged
    for name, true in truth.items():
        assert abs(found[name].value - true) < 4 * found[name].stderr, name
    assert found["position_m.lag"].stderr < 1e-5
    assert found.cost / found.problem.samples < 1.1


def test_the_stated_calibration_reaches_the_sensor(setup, setup_file):
    sensor = setup.model.sensors["position_m"]
    numbers = sensor.lag, sensor.gain, sensor.offset
    assert tuple(map(float, numbers)) == (0.018, 1.0, 0.5e-3)
    units = {one.name: one.unit for one in setup.parameters}
    assert units == {"stiffness": "1/s^2", "position_m.lag": "s", "position_m.gain": ""}
    # a second reading selects the same fields, and needs no other program
    again = fitting.read_setup(setup_file)
    assert [p.where for p in again.parameters] == [p.where for p in setup.parameters]


def test_a_calibration_that_the_rig_fits_is_no_missing_effect(setup):
    """Otherwise two parameters would be the same number of the model."""
    runs = (recorded(1), recorded(2))

    def said(*words):
        pass

    question = setup_question(*segmented(setup, runs, said, {}), None, said, Policy())
    offered = {term.name for term in (*question.terms, *question.unlisted)}
    assert offered.isdisjoint({"sensor_lag", "sensor_gain"})
    assert "sensor_offset" in offered
    assert {"position_m.lag", "position_m.gain"} <= {*question.rig}


def test_samples_are_moved_by_whole_intervals():
    time = 1e-3 * np.arange(100)
    two = {"height_m": np.sin(9 * (time - 0.0057)), "gyro_rad_s": np.cos(9 * time)}
    filled = np.arange(100) == 50
    run = Recording("run", time, two, filled=filled)
    model = fitting.Model(
        ImpactOscillator(), {"height_m": Sensor(0, 1e-3), "gyro_rad_s": Sensor(1, 1e-3)}
    )
    moved_model, (moved,) = without_lags(model, [run], {"height_m": 0.0057})
    assert len(moved) == 94
    np.testing.assert_array_equal(moved["height_m"], two["height_m"][6:])
    np.testing.assert_array_equal(moved["gyro_rad_s"], two["gyro_rad_s"][:94])
    assert moved.filled is not None
    assert np.flatnonzero(moved.filled).tolist() == [44, 50]
    removed = float(moved_model.sensors["height_m"].removed_lag)
    assert removed == pytest.approx(0.006, abs=1e-12)
    # nothing is moved twice
    same, (kept,) = without_lags(moved_model, [moved], {"height_m": 0.0057})
    assert len(kept) == 94 and float(same.sensors["height_m"].removed_lag) == removed


def test_recordings_of_other_intervals_are_unchanged():
    model = fitting.Model(ImpactOscillator(), {"height_m": Sensor(0, 1e-3)})
    runs = [
        Recording("run", step * np.arange(50), {"height_m": np.zeros(50)})
        for step in (1e-3, 2e-3)
    ]
    assert without_lags(model, runs, {"height_m": 0.01}) == (model, tuple(runs))


def test_a_lag_longer_than_a_recording_is_refused():
    run = Recording("run", 1e-3 * np.arange(9), {"height_m": np.zeros(9)})
    with pytest.raises(
        RecordingError, match="a lag of 8 samples leaves fewer than two"
    ):
        run.earlier("height_m", 8)


@pytest.mark.parametrize(
    "line, said",
    [
        ("lag = -0.1", "is negative"),
        ("gain = 0.0", "is zero"),
        ("offset = true", "is not a number"),
        ("lag = {value = 0.1, tolerance = -1.0}", "negative tolerance"),
    ],
)
def test_a_wrong_calibration_is_refused(tmp_path, line, said):
    text = (NEW_RIG / "cart.toml").read_text("utf-8")
    text = text.replace('sees = "position"', f'sees = "position"\n{line}')
    (tmp_path / "cart.toml").write_text(text)
    (tmp_path / "cart.py").write_text((NEW_RIG / "cart.py").read_text("utf-8"))
    with pytest.raises(RigError, match=said):
        fitting.read_setup(tmp_path / "cart.toml")
