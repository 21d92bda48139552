"""An input that is held or interpolated between its samples, in steps that do not end
at samples."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxcam import HybridSystem
from jaxcam.fitting import fit, Input, Model, Parameter, Problem, Sensor
from jaxcam.fitting.engine._driven_steps import line_error
from jaxcam.fitting.engine._fly import fly
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


@pytest.mark.parametrize("interpolation", ["hold", "linear"])
def test_the_difference_from_a_line_is_that_of_fine_sums(interpolation):
    """The largest integrals of the input minus its line, within 2 % of sums over 4000
    points of a step; a line within its samples has no difference."""
    rng = np.random.default_rng(5)
    time = _INTERVAL * np.arange(60)
    force = rng.standard_normal(60)
    run = Recording("run", time, {"position_m": 0 * time, "force_N": force})
    parts = [segment(run, "position_m", None, noise=_NOISE)]
    source = Input("force_N", _force, interpolation)
    edges = np.linspace(2.3e-3, 52.9e-3, 9)
    found = line_error(parts, source, edges[None, None])
    last = np.minimum(np.arange(60) + 1, 59)
    slopes = (force[last] - force) / _INTERVAL * (interpolation == "linear")
    for k, (a, b) in enumerate(zip(edges, edges[1:])):
        t = a + (np.arange(4000) + 0.5) * (b - a) / 4000
        row = np.floor(t / _INTERVAL).astype(int)
        level = force[row] + slopes[row] * (t - time[row])
        line = np.polynomial.Polynomial.fit(t, level, 1)
        once = np.cumsum(level - line(t)) * (b - a) / 4000
        twice = np.cumsum(once) * (b - a) / 4000
        inside = np.searchsorted(t, a + np.linspace(0.125, 0.875, 7) * (b - a))
        for sums, largest in ((once, found.once), (twice, found.twice)):
            assert np.max(np.abs(sums[inside])) == pytest.approx(
                largest[0, 0, k], rel=0.02, abs=1e-3 * np.max(np.abs(sums))
            )
    straight = Recording("run", time, {"position_m": 0 * time, "force_N": 2 + 3 * time})
    parts = [segment(straight, "position_m", None, noise=_NOISE)]
    source = Input("force_N", _force, "linear")
    found = line_error(parts, source, edges[None, None])
    assert max(np.max(one) for one in found) < 1e-12


def test_a_smooth_input_needs_fewer_steps_than_samples():
    """A sine of 80 samples a period: the end of each piece is within 0.01 noises of
    that with a step for each sample."""
    time = _INTERVAL * np.arange(_COUNT)
    rate = 2 * np.pi / (80 * _INTERVAL)
    force = np.sin(rate * time)
    place = _GAIN / rate * (time - np.sin(rate * time) / rate)
    noise = 1e-5
    rng = np.random.default_rng(0)
    noisy = place + noise * rng.standard_normal(_COUNT)
    run = Recording("run", time, {"position_m": noisy, "force_N": force})
    model = Model(
        Cart(),
        {"position_m": Sensor(0, noise=noise)},
        Input("force_N", _force, "linear"),
    )
    gain = Parameter("gain", lambda m: m.system.gain, tolerance=0.5)
    parts = [segment(run, "position_m", None, noise=noise)]
    problem = Problem.build(model, parts, [gain])
    pieces = problem.pieces
    part = pieces.flown
    used = np.asarray(pieces.exists)[0]
    length = np.asarray(part.step)[0, used]
    assert np.min(length) > 3 * _INTERVAL
    for k in np.flatnonzero(used)[:3]:
        start, h = float(part.start[0, k]), float(part.step[0, k])
        drive = jax.tree.map(lambda one: jnp.asarray(one[0, k]), pieces.drive)
        begin = jnp.array([0.1, 0.2])
        end, _ = fly(model, begin, jnp.asarray(start), jnp.asarray(h), drive)
        stop = start + pieces.steps * h
        once = _GAIN / rate * (np.cos(rate * start) - np.cos(rate * stop))
        speed = 0.2 + once
        moved = _GAIN / rate * np.cos(rate * start) * (stop - start)
        moved -= _GAIN / rate**2 * (np.sin(rate * stop) - np.sin(rate * start))
        exact = np.array([0.1 + 0.2 * (stop - start) + moved, speed])
        # the samples are joined by lines, which are below a sine by this fraction
        flat = (rate * _INTERVAL) ** 2 / 12 * _GAIN / rate * (stop - start)
        assert abs(float(end[0]) - exact[0]) < 0.01 * noise + 2 * flat
