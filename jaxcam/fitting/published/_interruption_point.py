"""The parameter at which complete chattering is interrupted, as a published number."""

from collections.abc import Callable
from typing import Any

import jax.numpy as jnp
from jaxtyping import Array, Float

from variational.chatter import interruption_in

from ...hybrid import HybridSystem
from ...parameters import as_arrays


def interruption_of_chattering(
    system: HybridSystem,
    where: Callable[[Any], Any],
    bracket: tuple[float, float],
    *,
    periods: int = 1,
) -> Float[Array, ""]:
    """The parameter at which complete chattering ends at the release point.

    [`variational.chatter_interruption`][] for use in a fit: differentiable forward in
    all other parameters, and NaN instead of an error when a step of the fit takes the
    interruption out of the bracket.

    **Arguments:** a system with two states, one constraint and a period; `where` picks
    the parameter; two values of it, wide around the published one, with chattering
    complete at one of them only; `periods` from release to the release after sticking.

    Returns:
        The parameter, in its own unit; NaN where the bracket holds no interruption.

    Raises:
        ValueError: For a system without a period.
    """
    system = as_arrays(system)
    found = interruption_in(system, where, *bracket, periods)
    return jnp.where(found.converged, found.value, jnp.nan)
