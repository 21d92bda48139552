"""An input that is held or interpolated between its samples, in steps that do not end
at samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.fitting import (
    fit,
    Input,
    Model,
    Output,
    Parameter,
    Problem,
    segment_by_model,
    Sensor,
)
from jaxcam.fitting.engine._fly import fly
from jaxcam.recordings import Recording, RecordingError, segment


_INTERVAL, _NOISE, _GAIN = 1e-3, 1e-7, 3.0
_COUNT = 1190


class Cart(HybridSystem):
    """A free mass that is pushed by a force."""

    gain: float = _GAIN
    force: float = 0.0

    def vector_field(self, t, state):
        return jnp.stack([state[1], self.gain * self.force])

    def gap(self, t, state):
        return jnp.ones_like(t)

    def impact(self, t, state):
        return state


def _moved(x, v, level, slope, s):
    """Position and velocity after a time `s` under a linear force, in closed form."""
    level, slope = _GAIN * level, _GAIN * slope
    place = x + v * s + level * s**2 / 2 + slope * s**3 / 6
    return place, v + level * s + slope * s**2 / 2


def _force(system):
    return system.force


@pytest.fixture(scope="module", params=["hold", "linear"])
def pushed(request):
    """A recording with a random force at every sample, its problem, and the exact
    position and velocity at any time."""
    rng = np.random.default_rng(3)
    force = rng.standard_normal(_COUNT)
    slopes = np.append(np.diff(force), 0.0) / _INTERVAL
    slopes = slopes * (request.param == "linear")
    samples = [(0.0, 0.0)]
    for level, slope in zip(force[:-1], slopes):
        samples.append(_moved(*samples[-1], level, slope, _INTERVAL))
    x = np.array([place for place, _ in samples])

    def at(t):
        k = min(int(np.floor(t / _INTERVAL + 1e-9)), _COUNT - 2)
        return np.array(_moved(*samples[k], force[k], slopes[k], t - k * _INTERVAL))

    time = _INTERVAL * np.arange(_COUNT)
    noisy = x + _NOISE * rng.standard_normal(_COUNT)
    run = Recording("run", time, {"position_m": noisy, "force_N": force})
    model = Model(
        Cart(),
        {"position_m": Sensor(0, noise=_NOISE)},
        Input("force_N", _force, request.param),
    )
    gain = Parameter("gain", lambda m: m.system.gain, tolerance=0.5)
    parts = [segment(run, "position_m", None, noise=_NOISE)]
    return Problem.build(model, parts, [gain]), at


def test_the_end_of_every_piece_is_exact(pushed):
    """To 1e-12 m and m/s: integral and first moment of the input are those of its
    samples, although no step ends at a sample."""
    problem, at = pushed
    pieces, model = problem.pieces, problem.layout.at(problem.start.values[0])
    part, exists = pieces.flown, np.flatnonzero(pieces.exists[0])
    step = np.asarray(part.step)[0, exists]
    assert np.all(np.abs(step / _INTERVAL - np.round(step / _INTERVAL)) > 1e-3)

    count = pieces.steps
    for k in exists:
        start, h = float(part.start[0, k]), float(part.step[0, k])
        end, _ = fly(
            model,
            jnp.asarray(at(start)),
            start,
            h,
            jax.tree.map(lambda part: jnp.asarray(part[0, k]), pieces.drive),
        )
        np.testing.assert_allclose(end, at(start + count * h), rtol=0, atol=1e-12)


def test_the_gain_of_an_input_is_not_biased(pushed):
    """Within three standard errors, and the cost is that of the noise."""
    found = fit(pushed[0])
    (gain,) = found.estimates
    assert abs(gain.value - _GAIN) < 3 * gain.stderr
    assert found.cost < pushed[0].samples + 5 * np.sqrt(2 * pushed[0].samples)


def recorded(system, position, force, interpolation, noise):
    """A recording of a system with a known position, and its problem."""
    time = _INTERVAL * np.arange(len(position))
    rng = np.random.default_rng(0)
    noisy = position + noise * rng.standard_normal(len(position))
    run = Recording("run", time, {"position_m": noisy, "force_N": force})
    model = Model(
        system,
        {"position_m": Sensor(0, noise=noise)},
        Input("force_N", _force, interpolation),
    )
    gain = Parameter("gain", lambda m: m.system.gain, tolerance=0.5)
    parts = [segment(run, "position_m", None, noise=noise)]
    return Problem.build(model, parts, [gain])


def test_a_smooth_input_needs_fewer_steps_than_samples():
    """A sine of 80 samples a period: after the first pieces, the position is within
    0.01 noises of that under the lines between the samples."""
    time = _INTERVAL * np.arange(_COUNT)
    force = np.sin(2 * np.pi * time / (80 * _INTERVAL))
    slopes = np.append(np.diff(force), 0.0) / _INTERVAL
    samples = [(0.0, 0.0)]
    for level, slope in zip(force[:-1], slopes):
        samples.append(_moved(*samples[-1], level, slope, _INTERVAL))
    place = np.array([x for x, _ in samples])
    problem = recorded(Cart(), place, force, "linear", noise := 1e-5)
    pieces = problem.pieces
    part, used = pieces.flown, np.flatnonzero(np.asarray(pieces.exists)[0])
    assert np.min(np.asarray(part.step)[0, used]) > 3 * _INTERVAL

    def at(t):
        k = min(int(np.floor(t / _INTERVAL + 1e-9)), _COUNT - 2)
        return np.array(_moved(*samples[k], force[k], slopes[k], t - k * _INTERVAL))

    model = problem.layout.at(problem.start.values[0])
    for k in used[:3]:
        start, h = float(part.start[0, k]), float(part.step[0, k])
        drive = jax.tree.map(lambda one: jnp.asarray(one[0, k]), pieces.drive)
        end, _ = fly(model, jnp.asarray(at(start)), start, h, drive)
        exact = at(start + pieces.steps * h)
        assert abs(float(end[0]) - exact[0]) < 0.01 * noise


class Actuated(Cart):
    """The mass is pushed through an actuator with a time constant."""

    delay: float = 0.02

    def vector_field(self, t, state):
        _, v, pushed = state
        return jnp.stack([v, self.gain * pushed, (self.force - pushed) / self.delay])


def test_an_input_behind_an_actuator_is_followed():
    """The input reaches the position through three integrations: at the end of every
    piece, the position is within 0.035 noises of the closed form, the bound for 2000
    samples. Steps that only the cubics require are off by up to 0.16 noises."""
    rng = np.random.default_rng(3)
    force = np.sign(rng.standard_normal(2001))
    decay, x, states = np.exp(-_INTERVAL / 0.02), np.zeros(3), []
    for level in force:
        states.append(x)
        off, h, tau = x[2] - level, _INTERVAL, 0.02
        once = level * h + off * tau * (1 - decay)
        twice = level * h**2 / 2 + off * tau * (h - tau * (1 - decay))
        x = np.array(
            [
                x[0] + x[1] * h + _GAIN * twice,
                x[1] + _GAIN * once,
                level + off * decay,
            ]
        )
    exact = np.array(states)
    problem = recorded(Actuated(), exact[:, 0], force, "hold", noise := 1e-6)
    pieces, part = problem.pieces, problem.pieces.flown
    model = problem.layout.at(problem.start.values[0])
    for k in np.flatnonzero(np.asarray(pieces.exists)[0]):
        start, h = float(part.start[0, k]), float(part.step[0, k])
        first = int(round(start / _INTERVAL))
        last = int(round((start + pieces.steps * h) / _INTERVAL))
        assert abs(first * _INTERVAL - start) < 1e-9
        drive = jax.tree.map(lambda one: jnp.asarray(one[0, k]), pieces.drive)
        end, _ = fly(model, jnp.asarray(exact[first]), start, h, drive, 4)
        assert abs(float(end[0]) - exact[last, 0]) < 0.035 * noise


class RubbedCart(Cart):
    """The same mass with smoothed dry friction."""

    steep = True


@pytest.mark.parametrize(("cart", "short"), [(Cart(), False), (RubbedCart(), True)])
def test_steps_with_steep_forces_are_as_short_as_the_samples(cart, short):
    """With a smooth input, other forces need only steps of several samples."""
    time = _INTERVAL * np.arange(_COUNT)
    force = np.sin(5 * time)
    place = -_GAIN * (np.sin(5 * time) / 25 - time / 5)
    run = Recording("run", time, {"position_m": place, "force_N": force})
    sensors = {"position_m": Sensor(0, noise=1e-5)}
    model = Model(cart, sensors, Input("force_N", _force, "linear"))
    part = segment(run, "position_m", None, noise=1e-5)
    pieces = Problem.build(model, [part], []).pieces
    step = float(np.max(np.where(pieces.exists, pieces.flown.step, 0.0)))
    assert (step <= _INTERVAL * (1 + 1e-9)) == short


@pytest.mark.parametrize("late", [0, 1])
def test_readings_at_jumps_of_the_input_are_not_used(late):
    """An accelerometer that is read before (1) or after (0) the jumps of a held force:
    the readings at the jumps by 2 are not used, those at the jumps by 1e-3 (0.15 of the
    noise) are, and the gain is within four standard errors."""
    time, noise = _INTERVAL * np.arange(_COUNT), 0.02
    large, small = np.arange(_COUNT) // 170 % 2, np.arange(_COUNT) // 7 % 2
    force = 2.0 * large + 1e-3 * small
    samples = [(0.0, 0.0)]
    for level in force[:-1]:
        samples.append(_moved(*samples[-1], level, 0.0, _INTERVAL))
    rng = np.random.default_rng(5)
    channels = {
        "position_m": np.array(samples)[:, 0] + 1e-6 * rng.standard_normal(_COUNT),
        "acceleration_m_s2": _GAIN * force[np.maximum(np.arange(_COUNT) - late, 0)]
        + noise * rng.standard_normal(_COUNT),
        "force_N": force,
    }
    sensors = {
        "position_m": Sensor(0, noise=1e-6),
        "acceleration_m_s2": Sensor(Output(1), noise=noise),
    }
    model = Model(Cart(gain=3.2), sensors, Input("force_N", _force))
    gain = Parameter("gain", lambda m: m.system.gain, tolerance=0.5)
    parts = [segment(Recording("run", time, channels), "position_m", None, noise=1e-6)]
    problem = Problem.build(model, parts, [gain])

    seen = dict(zip(sorted(sensors), np.moveaxis(problem.pieces.flown.known, -1, 0)))
    unused = seen["position_m"] & ~seen["acceleration_m_s2"]
    assert np.count_nonzero(unused) == np.count_nonzero(np.diff(large))
    (found,) = fit(problem).estimates
    assert abs(found.value - _GAIN) < 4 * found.stderr


@pytest.mark.parametrize("bandwidth", [np.inf, 300.0])
def test_an_input_that_always_jumps_leaves_no_readings(bandwidth):
    """With a random force, no reading of an accelerometer without a filter is known to
    follow or precede the jump; one with a filter does not jump.
    """
    rng, time = np.random.default_rng(2), _INTERVAL * np.arange(_COUNT)
    force = rng.standard_normal(_COUNT)
    channels = {
        "position_m": np.sin(time),
        "acceleration_m_s2": force,
        "force_N": force,
    }
    sensors = {
        "position_m": Sensor(0, noise=1e-6),
        "acceleration_m_s2": Sensor(Output(1), noise=0.02, bandwidth_hz=bandwidth),
    }
    model = Model(Cart(), sensors, Input("force_N", _force))
    parts = [segment(Recording("run", time, channels), "position_m", None, noise=1e-6)]
    if np.isfinite(bandwidth):
        known = Problem.build(model, parts, []).pieces.flown.known
        assert np.count_nonzero(known) > 2 * (_COUNT - 10)
    else:
        with pytest.raises(RecordingError, match="jumps at nearly every sample"):
            Problem.build(model, parts, [])


class Pressed(Cart):
    """A stop whose place is the input."""

    def gap(self, t, state):
        return self.force - state[0]


def test_a_gap_that_depends_on_an_input_is_refused():
    """The velocity of the stop is unknown; the message names the input."""
    time = _INTERVAL * np.arange(_COUNT)
    run = Recording("run", time, {"position_m": np.sin(time), "force_N": time})
    model = Model(
        Pressed(), {"position_m": Sensor(0, noise=1e-5)}, Input("force_N", _force)
    )
    part = segment(run, "position_m", None, noise=1e-5)
    with pytest.raises(ValueError, match="A gap of Pressed depends on the input 'for"):
        segment_by_model(model, [run])
    with pytest.raises(ValueError, match="the acceleration of the surface"):
        Problem.build(model, [part], [])
