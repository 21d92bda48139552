"""A point mass that runs on a spring leg."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import HybridAutomaton
from ._parameters import parameter, require_finite, require_positive


class SpringMassRunner(HybridAutomaton):
    """A point mass that runs on a massless spring leg.

    During flight, the leg is held at the angle of attack. It touches down where the
    falling mass reaches the height `length sin(attack)`, or at the apex if that is
    lower, always with its full length. In stance, it acts as a spring between the mass
    and the foot, which does not slip; it takes off where it has its full length again.
    The modes are `falling`, `stance`, `rising` and, if the mass reaches the ground,
    `fallen`, where the motion ends; it starts in the mode `falling`, for example at an
    apex. If the mass takes off downwards, it would land at once, and the simulation
    ends with `RESULTS.accumulates`. The state is (x, y, x', y'), where x is the
    distance of the mass ahead of the last foothold. No energy is lost before a fall.
    With the default parameters, steps from an apex height of 1 m at 5 m/s converge to a
    steady gait.

    R. Blickhan, The spring-mass model for running and hopping, Journal of Biomechanics
    22 (1989), 1217-1227; A. Seyfarth, H. Geyer, M. Guenther, R. Blickhan, A movement
    criterion for running, Journal of Biomechanics 35 (2002), 649-655.

    Examples:
        >>> from jaxcam.models import SpringMassRunner
        >>> run = jaxcam.simulate(SpringMassRunner(), [0.0, 1.0, 5.0, 0.0], 0.0, 0.4)
        >>> run.modes.names()
        ['falling', 'stance', 'rising', 'falling']
    """

    state_names: ClassVar[tuple[str, ...]] = ("distance", "height", "speed", "climb")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("m", "m", "m/s", "m/s")
    """Units of the state components."""
    modes: ClassVar[tuple[str, ...]] = ("falling", "stance", "rising", "fallen")
    """Names of the modes."""
    transitions: ClassVar[tuple[tuple[str, str], ...]] = (
        ("falling", "stance"),
        ("stance", "rising"),
        ("rising", "falling"),
        ("stance", "fallen"),
    )
    """Touchdown, take-off, apex and fall."""

    mass: jax.Array = parameter(80.0)
    """Mass (kg)."""
    stiffness: jax.Array = parameter(20e3)
    """Stiffness of the leg (N/m)."""
    length: jax.Array = parameter(1.0)
    """Length of the unloaded leg (m)."""
    attack: jax.Array = parameter(1.1868)
    """Angle between the leg and the ground at touchdown (rad)."""
    gravity: jax.Array = parameter(9.81)
    """Acceleration due to gravity (m/s^2)."""

    def fields(self, t, state, sides) -> jax.Array:
        """Return the rates in each mode, shape `(4, 4)`."""
        del t, sides
        x, y, speed, climb = state
        reach = jnp.sqrt(x * x + y * y)
        push = self.stiffness * (self.length - reach) / (self.mass * reach)
        flight = jnp.stack([speed, climb, 0.0 * x, -self.gravity])
        stance = jnp.stack([speed, climb, push * x, push * y - self.gravity])
        return jnp.stack([flight, stance, flight, jnp.zeros(4)])

    def guards(self, t, state) -> jax.Array:
        """Return the height above touchdown, the compression of the leg, the speed of
        climb, and the height above the ground.
        """
        del t
        x, y, _, climb = state
        height = y - self.length * jnp.sin(self.attack)
        compression = self.length - jnp.sqrt(x * x + y * y)
        return jnp.stack([height, compression, climb, y])

    def resets(self, t, state) -> jax.Array:
        """Return the state with x measured from the new foothold at touchdown."""
        del t
        foothold = jnp.sqrt(self.length**2 - state[1] ** 2)
        landed = state.at[0].set(-foothold)
        return jnp.stack([landed, state, state, state])

    def energy(self, state) -> jax.Array:
        """Return the energy of a state in flight (J)."""
        _, y, speed, climb = state
        return self.mass * ((speed * speed + climb * climb) / 2 + self.gravity * y)

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(
            mass=self.mass,
            stiffness=self.stiffness,
            length=self.length,
            gravity=self.gravity,
        )
        require_finite(attack=self.attack)
        if not 0 < float(self.attack) < jnp.pi / 2:
            raise ValueError(
                f"attack is {float(self.attack):g} rad; give an angle above 0 and "
                "below pi/2"
            )
