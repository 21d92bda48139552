"""An oscillator with dry friction."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import SwitchedSystem
from ._parameters import parameter, require_not_negative, require_positive


class DryFrictionOscillator(SwitchedSystem):
    """Forced oscillator with dry friction, dimensionless.

    `x'' + x = amplitude cos(omega t) - friction sgn(x')`; the state is (x, x'). At x' =
    0, the body sticks until the force on it reaches `static` times `friction`. Without
    forcing, each half cycle lasts pi and reduces the amplitude by `2 friction`.

    J. P. Den Hartog, Forced vibrations with combined Coulomb and viscous friction,
    Transactions of the ASME 53 (1931), APM-107-115.

    Examples:
        >>> from jaxcam.models import DryFrictionOscillator
        >>> system = DryFrictionOscillator(friction=0.3, amplitude=0.0)
        >>> run = jaxcam.simulate(system, [1.0, 0.0], 0.0, 12.0)
        >>> np.asarray(run.switches.time).round(6).tolist()
        [3.141593, 6.283185]
        >>> round(float(run.final[0]), 6)
        -0.2
    """

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity")
    """Names of the state's components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-")
    """Units of the state's components."""

    omega: jax.Array = parameter(0.5)
    """Angular frequency of the forcing."""
    friction: jax.Array = parameter(0.3)
    """Kinetic friction force, in units of the spring force at x = 1."""
    amplitude: jax.Array = parameter(1.0)
    """Amplitude of the forcing."""
    static: jax.Array = parameter(1.0)
    """Ratio of the static to the kinetic friction force, at least 1."""

    def switching(self, t, state) -> jax.Array:
        """Return the velocity."""
        del t
        return state[1]

    def branch(self, t, state, sides) -> jax.Array:
        """Return velocity and acceleration, shape `(2,)`."""
        force = self.amplitude * jnp.cos(self.omega * t) - self.friction * sides[0]
        return jnp.stack([state[1], force - state[0]])

    @property
    def holding(self) -> jax.Array:
        """Ratio of the static to the kinetic friction force."""
        return self.static

    @property
    def period(self) -> jax.Array:
        """Period of the forcing."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(omega=self.omega)
        require_not_negative(friction=self.friction, amplitude=self.amplitude)
