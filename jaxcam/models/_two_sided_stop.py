"""The forced linear oscillator between two rigid stops."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from ..hybrid import HybridSystem
from ._parameters import (
    parameter,
    require_not_negative,
    require_positive,
    require_restitution,
)


class TwoSidedStop(HybridSystem):
    """Forced linear oscillator between two rigid stops, dimensionless.

    `x'' + 2 damping x' + x = amplitude cos(omega t)` with `-clearance <= x <=
    clearance`; the state is (x, x'). The symmetric orbits with one impact per forcing
    period at each stop are known in closed form.

    S. W. Shaw, The dynamics of a harmonically excited system having rigid amplitude
    constraints, Journal of Applied Mechanics 52 (1985), 453-464.

    Examples:
        >>> from jaxcam.models import TwoSidedStop
        >>> TwoSidedStop(clearance=0.5).gap(0.0, jnp.array([0.2, 0.0])).tolist()
        [0.3, 0.7]
    """

    state_names: ClassVar[tuple[str, ...]] = ("position", "velocity")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-")
    """Units of the state components."""
    constraint_names: ClassVar[tuple[str, ...]] = ("upper stop", "lower stop")
    """Names of the constraints."""

    omega: jax.Array = parameter(2.8)
    """Angular frequency of the forcing."""
    amplitude: jax.Array = parameter(1.0)
    """Amplitude of the forcing."""
    clearance: jax.Array = parameter(0.1)
    """Distance of each stop from the equilibrium position."""
    restitution: jax.Array = parameter(0.8)
    """Coefficient of restitution at both stops, between 0 and 1."""
    damping: jax.Array = parameter(0.0)
    """Damping ratio."""

    def vector_field(self, t, state) -> jax.Array:
        """Return velocity and acceleration, shape `(2,)`."""
        x, velocity = state[0], state[1]
        force = self.amplitude * jnp.cos(self.omega * t)
        return jnp.stack([velocity, force - x - 2 * self.damping * velocity])

    def gap(self, t, state) -> jax.Array:
        """Return the distances to the upper and the lower stop, shape `(2,)`."""
        del t
        return jnp.stack([self.clearance - state[0], self.clearance + state[0]])

    def impact(self, t, state) -> jax.Array:
        """Return the states after impacts, shape `(2, 2)`; the velocity is multiplied
        by -restitution.
        """
        del t
        after = jnp.stack([state[0], -self.restitution * state[1]])
        return jnp.stack([after, after])

    @property
    def period(self) -> jax.Array:
        """Period of the forcing."""
        return 2 * jnp.pi / self.omega

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(omega=self.omega, clearance=self.clearance)
        require_restitution(self.restitution)
        require_not_negative(damping=self.damping, amplitude=self.amplitude)
