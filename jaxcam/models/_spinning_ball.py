"""A bouncing ball with friction and spin."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import SwitchedSystem
from ._parameters import (
    parameter,
    require_not_negative,
    require_positive,
    require_restitution,
)


class SpinningBall(SwitchedSystem):
    """A ball that bounces, slides and rolls on a floor.

    The state is (position, height, velocity, vertical velocity, spin); a rolling ball
    has the spin `velocity / radius`. The friction force and the friction impulse are at
    most `friction_coefficient` times the normal force and the normal impulse of the
    floor. A solid ball that starts to slide with velocity v and without spin begins to
    roll after `2 v / (7 mu g)`, with the velocity 5/7 v.

    R. Cross, Grip-slip behavior of a bouncing ball, American Journal of Physics 70
    (2002), 1093-1102.

    Examples:
        >>> from jaxcam.models import SpinningBall
        >>> ball = SpinningBall(friction_coefficient=0.2)
        >>> run = jaxcam.simulate(ball, [0.0, 0.0, 1.4, 0.0, 0.0], 0.0, 1.0)
        >>> run.switches.time.round(6).tolist()
        [0.203874]
        >>> run.final[2].round(9).item()
        1.0
    """

    state_names: ClassVar[tuple[str, ...]] = (
        "position",
        "height",
        "velocity",
        "height_rate",
        "spin",
    )
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("m", "m", "m/s", "m/s", "rad/s")
    """Units of the state components."""

    radius: jax.Array = parameter(0.02)
    """Radius (m)."""
    inertia: jax.Array = parameter(0.4)
    """Moment of inertia divided by mass and by radius squared: 2/5 for a solid ball."""
    friction_coefficient: jax.Array = parameter(0.3)
    """Coefficient of friction."""
    restitution: jax.Array = parameter(0.8)
    """Coefficient of restitution, between 0 and 1."""
    gravity: jax.Array = parameter(9.81)
    """Acceleration due to gravity (m/s^2)."""

    def switching(self, t, state) -> jax.Array:
        """Return the slip velocity of the lowest point (m/s)."""
        del t
        return state[2] - self.radius * state[4]

    def branch(self, t, state, sides) -> jax.Array:
        """Return the rates without contact, shape `(5,)`."""
        del t, sides
        zero = 0.0 * state[0]
        return jnp.stack([state[2], state[3], zero, zero - self.gravity, zero])

    def contact_friction(self, t, state, sides) -> jax.Array:
        """Return the friction per unit of the normal force, shape `(5,)`."""
        del t
        push = -self.friction_coefficient * sides[0]
        turn = -push / (self.inertia * self.radius)
        return jnp.zeros_like(state).at[2].set(push).at[4].set(turn)

    def gap(self, t, state) -> jax.Array:
        """Return the height of the lowest point (m), a scalar."""
        del t
        return state[1]

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact without friction, shape `(5,)`."""
        del t
        return state.at[3].multiply(-self.restitution)

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(radius=self.radius, inertia=self.inertia, gravity=self.gravity)
        require_restitution(self.restitution)
        require_not_negative(friction_coefficient=self.friction_coefficient)
