"""A simulated recording of a pendulum and the fitted model: nearly all residuals lie
within a band of plus or minus two standard deviations of the noise, so the model
explains the recording."""

import jax.numpy as jnp
import numpy as np

import jaxcam
from jaxcam.fitting import fit, Model, Parameter, Problem, residuals, Sensor
from jaxcam.plotting import compare_recording
from jaxcam.recordings import record, segment


class Swing(jaxcam.HybridSystem):
    """A damped pendulum, far from any stop."""

    stiffness: float = 140.0
    damping: float = 0.1

    def vector_field(self, t, state):
        pull = self.stiffness * jnp.sin(state[0]) + self.damping * state[1]
        return jnp.stack([state[1], -pull])

    def gap(self, t, state):
        return state[0] + 100.0

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5])


sensor = Sensor(0, noise=4e-3)
real = Swing(stiffness=150.0, damping=0.6)
made = {"angle_rad": sensor}
rng = np.random.default_rng(1)
recording = record(real, made, 4.0, rng=rng, state=[0.4, 0.0], interval=0.01)

model = Model(Swing(), made)
parameters = [
    Parameter("stiffness", lambda m: m.system.stiffness, scale=1.0, lower=0.0),
    Parameter("damping", lambda m: m.system.damping, scale=0.1, lower=0.0),
]
cut = segment(recording, "angle_rad", noise=sensor.noise)
found = fit(Problem.build(model, [cut], parameters))
print(found)

left = residuals(found)[0]
rows = np.rint(left.time / 0.01).astype(int)
fitted = np.full(len(recording), np.nan)
fitted[rows] = recording["angle_rad"][rows] - left.value
figure = compare_recording(
    recording,
    {"with fitted parameters": fitted},
    channel="angle_rad",
    noise=sensor.noise,
)
