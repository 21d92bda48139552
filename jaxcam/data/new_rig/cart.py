"""A cart on a spring between two stops: change it into the system that you have.

A system says three things of a state: how it moves freely, how far it is from each
thing that it can hit, and what an impact does. Units are SI.
"""

import jax.numpy as jnp

from jaxcam import HybridSystem


class Cart(HybridSystem):
    # the components of the state, in the order in which the functions below take them
    state_names = ("position", "velocity")
    state_units = ("m", "m/s")

    # parameters; cart.toml states their values and how well they are known
    stiffness: float = 40.0  # of the spring, divided by the mass (1/s^2)
    damping: float = 0.3  # divided by the mass (1/s)
    left: float = -0.05  # places of the stops (m)
    right: float = 0.06
    restitution_left: float = 0.7  # speed after an impact over the speed before it
    restitution_right: float = 0.7

    def vector_field(self, t, state):
        """Rate of change of the state in free motion: velocity and acceleration."""
        position, velocity = state
        acceleration = -self.stiffness * position - self.damping * velocity
        return jnp.stack([velocity, acceleration])

    def gap(self, t, state):
        """Distance to each stop (m): positive when free, zero in contact.

        With one stop it is a number, and `impact` returns one state.
        """
        return jnp.stack([state[0] - self.left, self.right - state[0]])

    def impact(self, t, state):
        """The state after an impact, a row for each stop.

        The velocity at which the gap closes is multiplied by -restitution.
        """
        position, velocity = state
        after_left = jnp.stack([position, -self.restitution_left * velocity])
        after_right = jnp.stack([position, -self.restitution_right * velocity])
        return jnp.stack([after_left, after_right])

    # A system that is driven has fields for its drive, `speed: float` (rad/s) and
    # `phase: float` (rad), uses `self.speed * t + self.phase` for the angle of the
    # drive, and states the period of it:
    #
    # @property
    # def period(self):
    #     return 2 * jnp.pi / self.speed
