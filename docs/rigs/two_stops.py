"""A sprung cart on a shaken base, between two stops."""

import jax.numpy as jnp

from jaxcam.hybrid import HybridSystem


class TwoStops(HybridSystem):
    """The position is relative to the base, which is at `base_amplitude * sin(phi)`."""

    state_names = ("position", "velocity")
    state_units = ("m", "m/s")
    constraint_names = ("left stop", "right stop")

    stiffness_over_mass: float = 61.5  # 1/s^2
    damping_over_mass: float = 0.12  # 1/s
    base_amplitude: float = 0.02  # m
    left: float = -0.05  # m
    right: float = 0.08  # m
    restitution_left: float = 0.75
    restitution_right: float = 0.6
    speed: float = 10.0  # speed of the drive, rad/s
    phase: float = 0.0  # phase of the drive at time zero, rad
    acceleration: float = 0.0  # acceleration of the drive, rad/s^2

    @property
    def period(self):
        return 2 * jnp.pi / self.speed

    def vector_field(self, t, state):
        x, v = state
        turned = self.speed * t + self.phase
        base = self.base_amplitude * (
            self.acceleration * jnp.cos(turned) - self.speed**2 * jnp.sin(turned)
        )
        pull = self.stiffness_over_mass * x + self.damping_over_mass * v
        return jnp.stack([v, -pull - base])

    def gap(self, t, state):
        x = state[0]
        return jnp.stack([x - self.left, self.right - x])

    def impact(self, t, state):
        x, v = state
        at_left = jnp.stack([x, -self.restitution_left * v])
        at_right = jnp.stack([x, -self.restitution_right * v])
        return jnp.stack([at_left, at_right])
