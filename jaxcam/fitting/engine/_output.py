"""Measured quantities that depend on the motion and its rate of change."""

import dataclasses

import jax.numpy as jnp
from jaxtyping import Array, Float

from ...hybrid import HybridSystem, Wrapping


@dataclasses.dataclass(frozen=True)
class Output:
    """A measured quantity that depends on the rate of change of the state, such as the
    reading of an accelerometer.

    Two outputs of the same name are equal, so problems of the same rig share compiled
    programs.

    Examples:
        >>> from jaxcam.fitting import Output
        >>> from jaxcam.models import BouncingBall
        >>> acceleration = Output(1)(BouncingBall(), 0.0, jnp.array([1.0, 0.0]))
        >>> float(acceleration)
        -9.81
    """

    of: int | str
    """Index of the state component whose rate of change is measured; or the name of a
    method `method(t, state, rate)` of the system, where `rate` is the rate of change of
    the state, shape `(n,)`, with all forces that are added to the system.
    """

    def __call__(self, system: HybridSystem, t, state: Float[Array, " n"]) -> Array:
        """Return the measured quantity."""
        rate = system.vector_field(t, state)
        if isinstance(self.of, int):
            return rate[self.of]
        while isinstance(system, Wrapping):
            system = system.inner
        return jnp.asarray(getattr(system, self.of)(t, state, rate))
