"""The direction of a motion, to which the plane of the phase condition is normal."""

from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import flow
from jaxcam.hybrid.programs import program


# fraction of a period over which the direction is computed
_SHORT = 1e-6


@program
def direction_of(problem: Any, u, parameters) -> Float[Array, " n"]:
    """Return the direction of the motion, relative to the sizes of the components, for
    a `SingleShooting` without forcing.
    """
    x, sizes = u[:-1], problem.scale(u, parameters)[:-1]
    end = _SHORT * u[-1]
    later = flow(parameters, x, jnp.zeros(()), end, settings=problem.settings).state
    away = (later - x) / sizes
    return away / jnp.linalg.norm(away)
