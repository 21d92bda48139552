"""A cart on a spring between two stops: an example to edit.

A system defines three functions of the state: the free motion, the gap to each
constraint, and the state after an impact. Without stops, leave out the last two, and
`constraint_names`. Units are SI.
"""

import jax.numpy as jnp

from jaxcam import HybridSystem


class Cart(HybridSystem):
    # the components of the state, in the order used by the functions below
    state_names = ("position", "velocity")
    state_units = ("m", "m/s")
    # the constraints, in the order of `gap` and `impact`
    constraint_names = ("left stop", "right stop")

    # parameters; cart.toml contains their values and tolerances
    stiffness: float = 40.0  # stiffness of the spring divided by the mass (1/s^2)
    damping: float = 0.3  # damping coefficient divided by the mass (1/s)
    left: float = -0.05  # positions of the stops (m)
    right: float = 0.06
    # speed after an impact divided by the speed before it
    restitution_left: float = 0.7
    restitution_right: float = 0.7

    def vector_field(self, t, state):
        """Return the rate of change of the state in free motion: velocity and
        acceleration.

        In a fit, `t` is the time in the time column of the recording.
        """
        position, velocity = state
        acceleration = -self.stiffness * position - self.damping * velocity
        return jnp.stack([velocity, acceleration])

    def gap(self, t, state):
        """Return the distance to each stop (m): positive when free, zero in contact.

        With a single stop, return one number here and one state from `impact`.
        """
        return jnp.stack([state[0] - self.left, self.right - state[0]])

    def impact(self, t, state):
        """Return the state after an impact, one row for each stop.

        The velocity at which the gap closes is multiplied by -restitution.
        """
        position, velocity = state
        after_left = jnp.stack([position, -self.restitution_left * velocity])
        after_right = jnp.stack([position, -self.restitution_right * velocity])
        return jnp.stack([after_left, after_right])

    # If the drive has an encoder, the system has two fields for it, `speed: float`
    # (rad/s) and `phase: float` (rad), and uses `self.speed * t + self.phase` as the
    # angle of the drive. If only the frequency of each recording is known, a field of
    # any name holds it; give its values under [records] in the rig file. If the phase
    # of the drive at t = 0 is unknown, it is a field as well; give it a tolerance and
    # `per_record = true` in the rig file. A driven system defines its period:
    #
    # @property
    # def period(self):
    #     return 2 * jnp.pi / self.speed
