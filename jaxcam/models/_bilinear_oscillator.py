"""An oscillator whose stiffness changes at a stop."""

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


class BilinearOscillator(SwitchedSystem):
    """Oscillator with a one-sided elastic stop, dimensionless.

    `x'' + 2 damping x' + k(x) = amplitude cos(omega t)`; the state is (x, x'). The
    restoring force is k = x up to the stop, and k = x + (stiffness - 1) (x - stop)
    beyond it. For free, undamped motion and a stop at zero, the half periods on the two
    sides are pi and pi / sqrt(stiffness). For infinite stiffness, the stop is the rigid
    wall of [`jaxcam.models.ImpactOscillator`][] with a coefficient of restitution of
    one.

    S. W. Shaw, P. J. Holmes, A periodically forced piecewise linear oscillator, Journal
    of Sound and Vibration 90 (1983), 129-155.

    Examples:
        >>> from jaxcam.models import BilinearOscillator
        >>> system = BilinearOscillator(stiffness=4.0)
        >>> run = jaxcam.simulate(system, [0.0, 1.0], 0.0, 6.0)
        >>> np.asarray(run.switches.time).round(6).tolist()
        [1.570796, 4.712389]
    """

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-")
    """Units of the state components."""

    stiffness: jax.Array = parameter(4.0)
    """Stiffness beyond the stop; before it the stiffness is one."""
    stop: jax.Array = parameter(0.0)
    """Position of the stop."""
    damping: jax.Array = parameter(0.0)
    """Damping ratio."""
    amplitude: jax.Array = parameter(0.0)
    """Amplitude of the forcing; default: no forcing."""
    omega: jax.Array = parameter(1.0)
    """Angular frequency of the forcing."""

    def switching(self, t, state) -> jax.Array:
        """Return the deflection of the stop, negative if there is no contact."""
        del t
        return state[0] - self.stop

    def branch(self, t, state, sides) -> jax.Array:
        """Return velocity and acceleration, shape `(2,)`."""
        x, velocity = state[0], state[1]
        pressed = (self.stiffness - 1.0) * (x - self.stop)
        spring = x + jnp.where(sides[0] > 0, 1.0, 0.0) * pressed
        force = self.amplitude * jnp.cos(self.omega * t)
        acceleration = force - spring - 2 * self.damping * velocity
        return jnp.stack([velocity, acceleration])

    @property
    def period(self) -> jax.Array:
        """Period of the forcing."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(stiffness=self.stiffness, omega=self.omega)
        require_finite(stop=self.stop, amplitude=self.amplitude)
        require_not_negative(damping=self.damping)
