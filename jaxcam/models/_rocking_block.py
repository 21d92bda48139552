"""A rigid block that rocks on a shaking floor."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem
from ._parameters import parameter, require_finite, require_positive


class RockingBlock(HybridSystem):
    """A uniform rigid block that stands on a floor, rocks on its corners, or falls
    over.

    The floor shakes horizontally with the acceleration `amplitude cos(omega t)`. The
    block does not slide. While it rocks on one corner, its angle q follows

        (4/3) R q'' = -g s sin(alpha - s q) - a cos(alpha - s q),

    with the sign s of q, the acceleration a of the floor, the half diagonal R, and
    tan(alpha) = `half_width / half_height`. At each change of corner, the rate of the
    angle is multiplied by `restitution`. As the rocking dies out, the impacts
    accumulate; the block then stands on both corners until `|a|` exceeds g tan(alpha).

    The state is (angle, lift, angle rate, lift rate). The lift is the angle's absolute
    value while a corner is in contact; the gaps of the left and the right corner are
    lift + angle and lift - angle. `rocking` returns the state for a given angle and
    rate.

    At small angles, the corner stays on the floor as long as `|a|` is below
    (1 + restitution) / (1 - restitution) g tan(alpha); above this limit, the corner
    leaves the floor, as the corner of a real block does if `restitution` is
    `housner_restitution`. While the block stands, and only then, the contact forces are
    those of a real block divided by its mass and `half_width`. A block that has fallen
    over is not stopped by the floor.

    G. W. Housner, The behavior of inverted pendulum structures during earthquakes,
    Bulletin of the Seismological Society of America 53 (1963); S. J. Hogan, On the
    dynamics of rigid-block motion under harmonic forcing, Proceedings of the Royal
    Society A 425 (1989).

    Examples:
        >>> from jaxcam.models import RockingBlock
        >>> block = RockingBlock()
        >>> block.gap(0.0, block.rocking(0.1)).tolist()
        [0.2, 0.0]
    """

    state_names: ClassVar[tuple[str, ...]] = (
        "angle",
        "lift",
        "angle_rate",
        "lift_rate",
    )
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("rad", "rad", "rad/s", "rad/s")
    """Units of the state components."""
    constraint_names: ClassVar[tuple[str, ...]] = ("left corner", "right corner")
    """Names of the constraints."""

    half_width: jax.Array = parameter(0.1)
    """Half the width of the block (m)."""
    half_height: jax.Array = parameter(0.4)
    """Half the height of the block (m)."""
    restitution: jax.Array = parameter(0.9)
    """Ratio of the angle rates after and before a change of corner, above 0 and below
    1; see `housner_restitution`.
    """
    amplitude: jax.Array = parameter(0.0)
    """Amplitude of the acceleration of the floor (m/s^2); default: floor at rest."""
    omega: jax.Array = parameter(6.0)
    """Angular frequency of the floor motion (rad/s)."""
    gravity: jax.Array = parameter(9.81)
    """Acceleration due to gravity (m/s^2)."""

    def vector_field(self, t, state) -> jax.Array:
        """Return the rates without contact, shape `(4,)`."""
        angle, _, angle_rate, lift_rate = state
        floor = self.amplitude * jnp.cos(self.omega * t)
        sine, cosine = jnp.sin(angle), jnp.cos(angle)
        diagonal = self.half_width**2 + self.half_height**2
        # with this factor, contact at one corner gives the equation of rocking about
        # that corner
        scale = (1 + self._share) / (4 / 3 * diagonal)
        turn = self.half_height * (self.gravity * sine - floor * cosine)
        press = self.half_width * (self.gravity * cosine + floor * sine)
        fall = -scale * press / self._share
        return jnp.stack([angle_rate, lift_rate, scale * turn, fall])

    def gap(self, t, state) -> jax.Array:
        """Return the gaps of the left and the right corner (rad), shape `(2,)`."""
        del t
        return jnp.stack([state[1] + state[0], state[1] - state[0]])

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact at each corner, shape `(2, 4)`."""
        del t
        angle, lift, angle_rate, lift_rate = state
        after = []
        for side in (1.0, -1.0):
            impulse = -(lift_rate + side * angle_rate) / (1 + self._share)
            turned = angle_rate + side * self._share * impulse
            after.append(jnp.stack([angle, lift, turned, lift_rate + impulse]))
        return jnp.stack(after)

    def rocking(self, angle, rate=0.0) -> jax.Array:
        """Return the state of a block that rocks on one corner, or stands.

        Args:
            angle: Angle of the block, positive to the right (rad).
            rate: Rate of the angle (rad/s).

        Returns:
            The state, shape `(4,)`.
        """
        angle = jnp.asarray(angle, dtype=jnp.float64)
        rate = jnp.asarray(rate, dtype=jnp.float64)
        side = jnp.where(angle == 0, jnp.sign(rate), jnp.sign(angle))
        return jnp.stack([angle, side * angle, rate, side * rate])

    @property
    def housner_restitution(self) -> jax.Array:
        """Value of `restitution` for a change of corner without slip or rebound, 1 -
        (3/2) sin(alpha)^2.
        """
        diagonal = self.half_width**2 + self.half_height**2
        return 1 - 1.5 * self.half_width**2 / diagonal

    @property
    def period(self) -> jax.Array:
        """Period of the floor motion (s)."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(
            half_width=self.half_width,
            half_height=self.half_height,
            omega=self.omega,
            gravity=self.gravity,
            restitution=self.restitution,
        )
        require_finite(amplitude=self.amplitude)
        if not bool(jnp.all(self.restitution < 1)):
            largest = float(jnp.max(self.restitution))
            raise ValueError(
                f"restitution is {largest:g}; it must be below 1, because a block "
                "loses energy when it changes corner"
            )

    @property
    def _share(self) -> jax.Array:
        """Change of the angle rate per change of the lift rate in an impact."""
        return (1 - self.restitution) / (1 + self.restitution)
