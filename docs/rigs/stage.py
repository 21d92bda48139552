"""A linear stage driven by a measured voltage, without impacts."""

import jax.numpy as jnp

from jaxcam.hybrid import HybridSystem


class Stage(HybridSystem):
    """A mass on a rail, driven by a motor."""

    state_names = ("position", "velocity")
    state_units = ("m", "m/s")

    gain: float = 2.0  # m/s^2 per volt
    damping: float = 6.0  # 1/s
    voltage: float = 0.0  # V, measured

    def vector_field(self, t, state):
        return jnp.stack([state[1], self.gain * self.voltage - self.damping * state[1]])
