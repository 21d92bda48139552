"""A stage that a voltage moves, and nothing to hit."""

import jax.numpy as jnp

from jaxcam import HybridSystem


class Stage(HybridSystem):
    """x'' = gain u - damping x'; its one gap never closes."""

    state_names = ("position", "velocity")
    state_units = ("m", "m/s")

    gain: float
    damping: float
    voltage: float

    def vector_field(self, t, state):
        push = self.gain * self.voltage - self.damping * state[1]
        return jnp.stack([state[1], push])

    def gap(self, t, state):
        return jnp.ones_like(state[0])

    def impact(self, t, state):
        return state
