"""A spring-loaded pressure relief valve that may hit its seat."""

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


class ReliefValve(HybridSystem):
    """Pressure relief valve supplied at a constant flow rate, dimensionless.

    The state is (lift, lift rate, pressure): `x'' + damping x' + x + preload =
    pressure`, and `pressure' = compressibility (flow - x sqrt(pressure))`. The seat is
    at lift zero. When the flow rate falls below a Hopf point, the valve begins to
    oscillate; when the oscillation reaches the seat, the valve hits it.

    G. Licsko, A. Champneys and C. Hos, Nonlinear analysis of a single stage pressure
    relief valve, IAENG International Journal of Applied Mathematics 39 (2009).

    Examples:
        >>> from jaxcam.models import ReliefValve
        >>> valve = ReliefValve()
        >>> rest = jnp.array([1.0, 0.0, 11.0])
        >>> valve.vector_field(0.0, rest).tolist()[:2]
        [0.0, 0.0]
    """

    state_names: ClassVar[tuple[str, ...]] = ("lift", "lift_rate", "pressure")
    """Names of the state components."""
    state_units: ClassVar[tuple[str, ...]] = ("-", "-", "-")
    """Units of the state components."""

    flow: jax.Array = parameter(7.0)
    """Flow rate into the chamber of the valve."""
    damping: jax.Array = parameter(1.25)
    """Damping of the valve."""
    preload: jax.Array = parameter(10.0)
    """Compression of the spring when the valve is closed."""
    compressibility: jax.Array = parameter(20.0)
    """Rise of pressure per unit of volume."""
    restitution: jax.Array = parameter(0.8)
    """Coefficient of restitution at the seat, between 0 and 1."""

    def vector_field(self, t, state) -> jax.Array:
        """Return the rates of lift, lift rate and pressure, shape `(3,)`."""
        del t
        lift, rate, pressure = state[0], state[1], state[2]
        out = lift * jnp.sqrt(pressure)
        return jnp.stack(
            [
                rate,
                pressure - self.preload - lift - self.damping * rate,
                self.compressibility * (self.flow - out),
            ]
        )

    def gap(self, t, state) -> jax.Array:
        """Return the lift, a scalar."""
        del t
        return state[0]

    def impact(self, t, state) -> jax.Array:
        """Return the state after an impact; the lift rate is multiplied by
        -restitution.
        """
        del t
        return jnp.stack([state[0], -self.restitution * state[1], state[2]])

    def check(self) -> None:
        """Raise `ValueError` if a parameter has an unphysical value."""
        require_positive(compressibility=self.compressibility, preload=self.preload)
        require_restitution(self.restitution)
        require_not_negative(damping=self.damping, flow=self.flow)
