"""A mass on a moving belt with dry friction."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..filippov import FilippovSystem
from ._parameters import (
    parameter,
    require_finite,
    require_not_negative,
    require_positive,
)


class BeltOscillator(FilippovSystem):
    """A mass on a moving belt with dry friction (stick-slip), dimensionless.

    `x'' + 2 damping x' + x = amplitude cos(omega t) + friction force`; the state is (x,
    x'). The belt moves at constant speed and drags the mass with the force `friction /
    (1 + weakening |x' - belt|)`, which decreases with the slip speed, so the mass
    sticks and slips. Sticking of the mass is sliding (in the sense of Filippov) on the
    surface x' = belt.

    R. I. Leine, D. H. van Campen, A. de Kraker, L. van den Steen, Stick-slip vibrations
    induced by alternate friction models, Nonlinear Dynamics 16 (1998), 41-54.

    Examples:
        >>> from jaxcam.models import BeltOscillator
        >>> float(BeltOscillator(belt=0.2).switching(0.0, jnp.array([0.0, 0.5])))
        0.3
    """

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-")
    """Units of the state components."""

    belt: jax.Array = parameter(0.2)
    """Speed of the belt."""
    friction: jax.Array = parameter(1.0)
    """Maximum friction force, in units of the spring force at x = 1."""
    weakening: jax.Array = parameter(3.0)
    """Rate at which friction decreases with slip speed; zero gives Coulomb's law."""
    damping: jax.Array = parameter(0.0)
    """Damping ratio."""
    amplitude: jax.Array = parameter(0.0)
    """Amplitude of the forcing; default: no forcing."""
    omega: jax.Array = parameter(1.0)
    """Angular frequency of the forcing."""

    def above(self, t, state) -> jax.Array:
        """Return the rates while the mass is faster than the belt and friction
        decelerates it.
        """
        return self._pulled(t, state, -1.0)

    def below(self, t, state) -> jax.Array:
        """Return the rates while the mass is slower than the belt and friction
        accelerates it.
        """
        return self._pulled(t, state, 1.0)

    def switching(self, t, state) -> jax.Array:
        """Return the slip velocity."""
        del t
        return state[1] - self.belt

    @property
    def period(self):
        """Period of the forcing."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(friction=self.friction, omega=self.omega)
        require_not_negative(weakening=self.weakening, damping=self.damping)
        require_finite(belt=self.belt, amplitude=self.amplitude)

    def _pulled(self, t, state, side):
        x, velocity = state[0], state[1]
        # `side` is 1 while the mass is slower than the belt and -1 while it is faster;
        # the magnitude of the slip is continued smoothly beyond the surface
        slip = -side * (velocity - self.belt)
        force = side * self.friction / (1 + self.weakening * slip)
        drive = self.amplitude * jnp.cos(self.omega * t)
        acceleration = drive + force - x - 2 * self.damping * velocity
        return jnp.stack([velocity, acceleration])
