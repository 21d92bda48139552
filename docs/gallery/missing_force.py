"""The force that a model lacks, identified from a simulated recording: a polynomial in
the velocity is fitted together with the stiffness, here to a pendulum with air drag."""

import jax
import jax.numpy as jnp
import matplotlib.pyplot as plt
import numpy as np

import jaxcam
from jaxcam.fitting import fit, Model, Parameter, Problem, Sensor
from jaxcam.plotting import style
from jaxcam.plotting.colours import IMPACT, SECTION
from jaxcam.recordings import record, segment


class Swing(jaxcam.HybridSystem):
    """A pendulum with air drag and with a polynomial force, which is to be fitted."""

    stiffness: float = 140.0
    first: float = 0.0
    third: float = 0.0
    fifth: float = 0.0
    air: float = 0.0

    def missing(self, v):
        odd = self.first * v + self.third * v**3 + self.fifth * v**5
        return -odd - self.air * v * jnp.abs(v)

    def vector_field(self, t, state):
        pull = self.stiffness * jnp.sin(state[0])
        return jnp.stack([state[1], self.missing(state[1]) - pull])

    def gap(self, t, state):
        return state[0] + 100.0

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5])


real, sensors = Swing(stiffness=150.0, air=0.25), {"angle_rad": Sensor(0, noise=1e-2)}
rng = np.random.default_rng(1)
recording = record(real, sensors, 6.0, rng=rng, state=[0.5, 0.0], interval=0.01)
cut = segment(recording, "angle_rad", noise=1e-2)
shape = ("first", "third", "fifth")
known = Parameter("stiffness", lambda m: m.system.stiffness, scale=1.0)
free = [
    Parameter(name, lambda m, name=name: getattr(m.system, name), scale=0.1)
    for name in shape
]
found = fit(Problem.build(Model(Swing(), sensors), [cut], [known, *free]))

v = np.linspace(-5.5, 5.5, 200)
powers = -np.stack([v, v**3, v**5], axis=1)
force = powers @ [found[name].value for name in shape]
error = np.sqrt(np.sum((powers @ found.covariance[1:, 1:]) * powers, axis=1))
with style():
    figure, ax = plt.subplots()
    ax.fill_between(
        v, force - 2 * error, force + 2 * error, color=IMPACT, alpha=0.3, lw=0
    )
    ax.plot(v, force, color=IMPACT, label="fitted, ± 2 standard errors")
    ax.plot(v, jax.vmap(real.missing)(v), "--", color=SECTION, lw=1, label="exact")
    ax.set(xlabel="velocity (rad/s)", ylabel="missing acceleration (rad/s²)")
    ax.legend()
