"""An input that is held or interpolated between its samples, in steps that do not end
at samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.fitting import fit, Input, Model, Parameter, Problem, Sensor
from jaxcam.fitting.engine._predict import fly
from jaxcam.recordings import Recording, segment


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
