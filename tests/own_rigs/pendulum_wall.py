"""A pendulum on a shaken base, beside a wall."""

import jax.numpy as jnp

from jaxcam import HybridSystem


class PendulumWall(HybridSystem):
    """The second state is the rate of the angle plus (b'/l) cos(angle), as in space."""

    state_names = ("angle", "rate_in_space")
    state_units = ("rad", "rad/s")

    gravity: float
    damping: float
    amplitude: float
    wall: float
    restitution: float
    speed: float
    phase: float

    def base_rate(self, t):
        return self.amplitude * self.speed * jnp.cos(self.speed * t + self.phase)

    def vector_field(self, t, state):
        angle, base = state[0], self.base_rate(t)
        rate = state[1] - base * jnp.cos(angle)
        pull = self.gravity * jnp.sin(angle) + self.damping * rate
        return jnp.stack([rate, -pull - base * jnp.sin(angle) * rate])

    def gap(self, t, state):
        return state[0] - self.wall

    def impact(self, t, state):
        base = self.base_rate(t) * jnp.cos(state[0])
        rate = -self.restitution * (state[1] - base)
        return jnp.stack([state[0], base + rate])

    @property
    def period(self):
        return 2 * jnp.pi / self.speed
