"""A mass between two walls: the two gaps against time, and the impacts on each wall."""

from typing import ClassVar

import jax.numpy as jnp

import jaxcam
from jaxcam.plotting import time_history


class TwoWalls(jaxcam.HybridSystem):
    state_names: ClassVar = ("position", "velocity")
    state_units: ClassVar = ("m", "m/s")
    constraint_names: ClassVar = ("left wall", "right wall")

    half_width: float = 0.5
    restitution: float = 0.7
    frequency: float = 3.0

    def vector_field(self, t, state):
        push = 8.0 * jnp.cos(self.frequency * t)
        return jnp.stack([state[1], push - 0.2 * state[1] - state[0]])

    def gap(self, t, state):
        return jnp.stack([self.half_width + state[0], self.half_width - state[0]])

    def impact(self, t, state):
        after = jnp.stack([state[0], -self.restitution * state[1]])
        return jnp.stack([after, after])

    @property
    def period(self):
        return 2 * jnp.pi / self.frequency


trajectory = jaxcam.simulate(TwoWalls(), jnp.zeros(2), 0.0, 12.0)
figure = time_history(trajectory, components=[0], between=(6.0, 12.0))
figure.set_size_inches(6.4, 4.6)
