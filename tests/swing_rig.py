"""A damped mass on a spring, far from any stop, for tests of the diagnosis."""

import jax.numpy as jnp

from jaxcam import HybridSystem
from jaxcam.fitting import Parameter


class Swing(HybridSystem):
    """A damped mass on a spring, far from any stop."""

    stiffness: float = 149.0
    damping: float = 0.1

    def vector_field(self, t, state):
        force = self.stiffness * state[0] + self.damping * state[1]
        return jnp.stack([state[1], -force])

    def gap(self, t, state):
        return state[0] + 100.0

    def impact(self, t, state):
        return state * jnp.array([1.0, -0.5])


PARAMETERS = (
    Parameter("stiffness", lambda m: m.system.stiffness, 3.0, unit="1/s^2"),
    Parameter("damping", lambda m: m.system.damping, 0.05, unit="1/s"),
)
