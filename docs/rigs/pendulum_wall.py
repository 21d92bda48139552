"""A pendulum next to a wall, with a pivot that is shaken sideways."""

import jax.numpy as jnp

from jaxcam.hybrid import HybridSystem


class PendulumWall(HybridSystem):
    """The pivot moves by `base_amplitude_over_length * sin(phi)` times the length."""

    state_names = ("angle", "velocity")
    state_units = ("rad", "rad/s")

    gravity_over_length: float = 39.24  # 1/s^2
    damping: float = 0.03  # 1/s
    base_amplitude_over_length: float = 0.1
    wall: float = -0.15  # rad
    restitution: float = 0.7
    speed: float = 10.0  # speed of the drive, rad/s
    phase: float = 0.0  # phase of the drive at time zero, rad
    acceleration: float = 0.0  # acceleration of the drive, rad/s^2

    @property
    def period(self):
        return 2 * jnp.pi / self.speed

    def vector_field(self, t, state):
        angle, v = state
        turned = self.speed * t + self.phase
        base = self.base_amplitude_over_length * (
            self.acceleration * jnp.cos(turned) - self.speed**2 * jnp.sin(turned)
        )
        weight = self.gravity_over_length * jnp.sin(angle)
        return jnp.stack([v, -weight - self.damping * v - base * jnp.cos(angle)])

    def gap(self, t, state):
        return state[0] - self.wall

    def impact(self, t, state):
        return jnp.stack([state[0], -self.restitution * state[1]])
