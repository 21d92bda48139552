"""Textbook model of a rigid pendulum without friction."""

import jax.numpy as jnp

from jaxcam import HybridSystem


class Pendulum(HybridSystem):
    """The angle is the encoder reading; `hanging` is its value at rest."""

    state_names = ("angle", "rate")
    state_units = ("rad", "rad/s")

    stiffness: float = 60.0  # torque of gravity divided by the inertia, 1/s^2
    hanging: float = 3.14159  # rad

    def vector_field(self, t, state):
        angle, rate = state
        return jnp.stack([rate, -self.stiffness * jnp.sin(angle - self.hanging)])
