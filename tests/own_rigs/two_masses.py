"""Two masses: one beside a wall, the other shaken, and each hits the other."""

import jax.numpy as jnp

from jaxcam import HybridSystem


class TwoMasses(HybridSystem):
    """Mass 1 hits the wall at zero, mass 2 hits mass 1; momentum is conserved."""

    state_names = ("position1", "position2", "velocity1", "velocity2")
    state_units = ("m", "m", "m/s", "m/s")

    stiffness1: float
    damping1: float
    rest1: float
    stiffness2: float
    damping2: float
    rest2: float
    amplitude: float
    mass_ratio: float
    restitution_wall: float
    restitution_masses: float
    speed: float
    phase: float

    def vector_field(self, t, state):
        x1, x2, v1, v2 = state
        support = self.rest2 + self.amplitude * jnp.sin(self.speed * t + self.phase)
        a1 = -self.stiffness1 * (x1 - self.rest1) - self.damping1 * v1
        a2 = -self.stiffness2 * (x2 - support) - self.damping2 * v2
        return jnp.stack([v1, v2, a1, a2])

    def gap(self, t, state):
        return jnp.stack([state[0], state[1] - state[0]])

    def impact(self, t, state):
        x1, x2, v1, v2 = state
        change = (1 + self.restitution_masses) * (v1 - v2) / (1 + self.mass_ratio)
        return jnp.stack(
            [
                jnp.stack([x1, x2, -self.restitution_wall * v1, v2]),
                jnp.stack([x1, x2, v1 - self.mass_ratio * change, v2 + change]),
            ]
        )

    @property
    def period(self):
        return 2 * jnp.pi / self.speed
