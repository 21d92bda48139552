"""A gear pair with backlash between its teeth."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import SwitchedSystem
from ._parameters import (
    parameter,
    require_finite,
    require_not_negative,
    require_positive,
)


class GearBacklash(SwitchedSystem):
    """Gear pair with backlash and elastic teeth, dimensionless.

    `x'' + 2 damping x' + g(x) = load + amplitude cos(omega t)`, where x is the
    difference of the two gears' displacements along the line of action (the
    transmission error) and half the backlash is `clearance`. The teeth touch on the
    driving flank for x > clearance, on the opposite flank for x < -clearance, and are
    separated in between:

        g(x) = x - clearance, x > clearance; 0, |x| < clearance; x + clearance,
        x < -clearance.

    The state is (x, x'). Time is in units of the inverse natural frequency of the pair
    with its teeth in contact. The damping models the bearings and acts even while the
    teeth are separated.

    A. Kahraman, R. Singh, Non-linear dynamics of a spur gear pair, Journal of Sound and
    Vibration 142 (1990), 49-75.

    Examples:
        >>> from jaxcam.models import GearBacklash
        >>> system = GearBacklash(load=0.0, amplitude=0.0)
        >>> run = jaxcam.simulate(system, [0.0, 1.0], 0.0, 5.0)
        >>> np.asarray(run.switches.surface).tolist()
        [0, 0]
    """

    state_names: ClassVar[tuple[str, ...]] = ("transmission error", "velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-")
    """Units of the state components."""

    clearance: jax.Array = parameter(1.0)
    """Half the backlash."""
    load: jax.Array = parameter(0.1)
    """Mean load, in units of the tooth force at a deflection of one."""
    damping: jax.Array = parameter(0.0)
    """Damping ratio."""
    amplitude: jax.Array = parameter(0.0)
    """Amplitude of the forcing; default: no forcing."""
    omega: jax.Array = parameter(1.0)
    """Angular frequency of the forcing (the meshing frequency)."""

    def switching(self, t, state) -> jax.Array:
        """Return the deflections of the two flanks, positive towards larger x."""
        del t
        return jnp.stack([state[0] - self.clearance, state[0] + self.clearance])

    def branch(self, t, state, sides) -> jax.Array:
        """Return velocity and acceleration, shape `(2,)`."""
        x, velocity = state[0], state[1]
        driving = jnp.where(sides[0] > 0, 1.0, 0.0) * (x - self.clearance)
        back = jnp.where(sides[1] < 0, 1.0, 0.0) * (x + self.clearance)
        force = self.load + self.amplitude * jnp.cos(self.omega * t)
        acceleration = force - driving - back - 2 * self.damping * velocity
        return jnp.stack([velocity, acceleration])

    @property
    def period(self) -> jax.Array:
        """Period of the forcing."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(clearance=self.clearance, omega=self.omega)
        require_finite(load=self.load, amplitude=self.amplitude)
        require_not_negative(damping=self.damping)
