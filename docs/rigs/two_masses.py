"""Two sprung masses: the first hits a wall, and the second, which is shaken, hits the
first.
"""

import jax.numpy as jnp

from jaxcam.hybrid import HybridSystem


class TwoMasses(HybridSystem):
    """The wall is at `x1 = 0`, and the masses touch when `x2 = x1`."""

    state_names = ("x1", "v1", "x2", "v2")
    state_units = ("m", "m/s", "m", "m/s")
    constraint_names = ("wall", "other mass")

    k1_over_m1: float = 2500.0  # 1/s^2
    c1_over_m1: float = 2.0  # 1/s
    rest1: float = 0.003  # m
    k2_over_m2: float = 1800.0  # 1/s^2
    c2_over_m2: float = 1.5  # 1/s
    rest2: float = 0.012  # m
    shaker_amplitude: float = 0.005  # m
    mass_ratio: float = 0.7  # m2 / m1
    restitution_wall: float = 0.65
    restitution_masses: float = 0.7
    speed: float = 50.0  # speed of the drive, rad/s
    phase: float = 0.0  # phase of the drive at time zero, rad

    @property
    def period(self):
        return 2 * jnp.pi / self.speed

    def vector_field(self, t, state):
        x1, v1, x2, v2 = state
        shaken = self.shaker_amplitude * jnp.sin(self.speed * t + self.phase)
        a1 = -self.k1_over_m1 * (x1 - self.rest1) - self.c1_over_m1 * v1
        a2 = -self.k2_over_m2 * (x2 - self.rest2 - shaken) - self.c2_over_m2 * v2
        return jnp.stack([v1, a1, v2, a2])

    def gap(self, t, state):
        x1, _, x2, _ = state
        return jnp.stack([x1, x2 - x1])

    def impact(self, t, state):
        x1, v1, x2, v2 = state
        on_wall = jnp.stack([x1, -self.restitution_wall * v1, x2, v2])
        # conserved momentum; separation speed = restitution times approach speed
        common = (v1 + self.mass_ratio * v2) / (1 + self.mass_ratio)
        parting = self.restitution_masses * (v1 - v2)
        w1 = common - self.mass_ratio * parting / (1 + self.mass_ratio)
        together = jnp.stack([x1, w1, x2, w1 + parting])
        return jnp.stack([on_wall, together])
