"""Measure the size of each component of a motion, for dimensionless comparisons."""

import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from ..parameters import as_arrays
from ._system import HybridSystem
from .programs import program


def component_sizes(
    system: HybridSystem,
    t: Float[ArrayLike, ""],
    state: Float[ArrayLike, " n"],
    period: Float[ArrayLike, ""],
) -> Float[Array, " n"]:
    """Return the scale of each state component, for relative comparisons of two states.

    The scale is the magnitude of the component plus the distance that its rate of
    change in free flight covers in period / (2 pi). For a harmonic motion, this is of
    the order of the amplitude at every phase.

    Args:
        system: The system.
        t: Time (s).
        state: State, shape `(n,)`.
        period: Period of the motion (s).

    Returns:
        Scales in the units of the state, shape `(n,)`.

    Examples:
        >>> from jaxcam.hybrid.sizes import component_sizes
        >>> from jaxcam.models import ImpactOscillator
        >>> component_sizes(ImpactOscillator(), 0.0, jnp.zeros(2), 2.0).shape
        (2,)
    """
    numbers = (jnp.asarray(x, dtype=jnp.float64) for x in (t, state, period))
    return _sizes(as_arrays(system), *numbers)


@program
def _sizes(system, t, state, period):
    rates = system.vector_field(t, state)
    return jnp.abs(state) + period / (2 * jnp.pi) * jnp.abs(rates)
