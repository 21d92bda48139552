"""The direction of a motion, to which the plane of the phase condition is normal."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import Settings
from jaxcam.hybrid.flow_jacobian import unchecked_flow
from jaxcam.hybrid.sizes import component_sizes


# fraction of a period over which the direction is computed
_SHORT = 1e-6


def direction_of(system, state, t0, period, settings: Settings) -> Float[Array, " n"]:
    """Return the unit vector of the motion from a state, relative to the sizes of the
    components over a `period` (s).
    """
    sizes = component_sizes(system, t0, state, period)
    # a component that remains zero has no size
    sizes = jnp.where(sizes > 0, sizes, 1.0)
    later = unchecked_flow(system, state, t0, t0 + _SHORT * period, settings).state
    away = (later - state) / sizes
    return away / jnp.linalg.norm(away)
