"""Measure the scale of each gap of a motion, for dimensionless comparisons."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.sizes import component_sizes
from jaxcam.hybrid.surface import gaps


def gap_sizes(
    system: HybridSystem,
    t: Float[ArrayLike, ""],
    state: Float[ArrayLike, " n"],
    period: Float[ArrayLike, ""],
) -> Float[Array, " m"]:
    """Return the scale of each gap, in the unit of that gap.

    The scale is the largest change of the gap when each state component changes by its
    size ([`jaxcam.hybrid.sizes.component_sizes`][]).

    **Arguments:** time (s), state `(n,)`, and the period of the motion (s).

    Returns:
        Scales, one for each constraint, shape `(m,)`.
    """
    sizes = component_sizes(system, t, state, period)
    slopes = jax.jacfwd(lambda x: gaps(system, t, x))(jnp.asarray(state))
    return jnp.abs(slopes) @ sizes
