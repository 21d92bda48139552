"""A sprung cart on a shaken base, between two stops."""

import jax.numpy as jnp

from jaxcam import HybridSystem


class TwoStops(HybridSystem):
    """The base is at b = amplitude sin(speed t + phase); the cart at b + position.

    The second state is the velocity in space: its rate does not need the acceleration
    of the base, which no encoder shows.
    """

    state_names = ("position", "velocity_in_space")
    state_units = ("m", "m/s")

    stiffness: float = 61.5
    damping: float = 0.12
    amplitude: float = 0.02
    left: float = -0.05
    right: float = 0.08
    restitution_left: float = 0.75
    restitution_right: float = 0.6
    speed: float = 12.0
    phase: float = 0.0

    def base_velocity(self, t):
        return self.amplitude * self.speed * jnp.cos(self.speed * t + self.phase)

    def vector_field(self, t, state):
        velocity = state[1] - self.base_velocity(t)
        pull = self.stiffness * state[0] + self.damping * velocity
        return jnp.stack([velocity, -pull])

    def gap(self, t, state):
        return jnp.stack([state[0] - self.left, self.right - state[0]])

    def impact(self, t, state):
        base = self.base_velocity(t)
        velocity = state[1] - base
        return jnp.stack(
            [
                jnp.stack([state[0], base - self.restitution_left * velocity]),
                jnp.stack([state[0], base - self.restitution_right * velocity]),
            ]
        )

    @property
    def period(self):
        return 2 * jnp.pi / self.speed
