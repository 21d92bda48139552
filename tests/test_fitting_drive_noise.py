"""Effect of the noise of a drive's encoder on the motion in flight."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from scipy.signal import savgol_filter

from jaxcam.fitting import Model, Parameter, Problem, segment_by_model, Sensor, Turning
from jaxcam.fitting.engine import DriveState
from jaxcam.fitting.engine._fly import fly
from jaxcam.hybrid import HybridSystem
from jaxcam.recordings import Recording


AMPLITUDE, NOISE, INTERVAL, COUNT = 0.1, 2e-4, 5e-4, 2400
# the force does not depend on the speed at both ends, where the motion is not complete
SPEED = 5 * np.pi / (INTERVAL * (COUNT - 1))


def _speed(system):
    return system.speed


def _phase(system):
    return system.phase


def _amplitude(model):
    return model.system.amplitude


class Shaken(HybridSystem):
    """A free mass, driven by a force that follows an unbalanced drive."""

    speed: float = SPEED
    phase: float = 0.0
    amplitude: float = AMPLITUDE

    @property
    def period(self):
        return 2 * jnp.pi / self.speed

    def vector_field(self, t, state):
        force = self.amplitude * self.speed**2 * jnp.sin(self.speed * t + self.phase)
        return jnp.stack([state[1], force])

    def gap(self, t, state):
        return state[0] + 10.0

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5])


def test_the_error_of_a_flight_agrees_with_repeated_noise():
    """The standard error of the velocity after a second, to 15 per cent."""
    rng = np.random.default_rng(0)
    time = INTERVAL * np.arange(COUNT)
    angle = SPEED * time
    position = -AMPLITUDE * np.sin(angle)
    channels = {
        "angle_rad": angle + NOISE * rng.standard_normal(len(time)),
        "position_m": position + 1e-6 * rng.standard_normal(len(time)),
    }
    run = Recording("free", time, channels)
    model = Model(
        Shaken(), {"position_m": Sensor(0, noise=1e-6)}, Turning(_speed, _phase)
    )
    size = Parameter("amplitude", _amplitude, tolerance=1e-3)
    parts = segment_by_model(model, [run], [size], drive_channel="angle_rad")
    problem = Problem.build(model, parts, [size])
    pieces = jax.tree.map(lambda leaf: leaf[0], problem.pieces)
    exists = np.asarray(pieces.exists)
    flight = np.asarray(problem.extras.sharpness.flight)[0, exists, 1]
    count = int(np.sum(exists))
    starts, steps = (
        np.asarray(x)[:count] for x in (pieces.flown.start, pieces.flown.step)
    )
    middle = starts[:, None] + steps[:, None] * (np.arange(pieces.steps) + 0.5)

    @eqx.filter_jit
    def ends(angles, rates):
        def one(angles, rates):
            state = jnp.zeros(2)
            for k in range(count):
                drive = DriveState(angles[k], rates[k], jnp.zeros_like(rates[k]))
                state, _ = fly(problem.model, state, starts[k], steps[k], drive)
            return state[1]

        return jax.vmap(one)(angles, rates)

    noise = NOISE * rng.standard_normal((200, len(time)))
    shift = np.asarray(savgol_filter(noise, 101, 2))
    change = np.asarray(savgol_filter(noise, 101, 2, deriv=1, delta=INTERVAL))

    def at(values, where):
        return np.array([np.interp(where, time, row) for row in values])

    edges = starts[:, None] + steps[:, None] * np.arange(pieces.steps + 1)
    turned = np.cumsum(change, axis=1) * INTERVAL
    mean = np.diff(at(turned, edges), axis=-1) / steps[:, None]
    clean = jnp.asarray(np.broadcast_to(SPEED * middle, (200, *middle.shape)))
    moved = ends(clean + at(shift, middle), SPEED + mean)
    moved = np.asarray(moved - ends(clean, jnp.full_like(clean, SPEED)))
    expected = np.sqrt(np.sum(flight[1:] ** 2) * count / (count - 1))
    assert abs(np.std(moved) / expected - 1) < 0.15
