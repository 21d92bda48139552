"""Compute the parameter at which complete chatter is interrupted, for a fit."""

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
    """Return the parameter value at which chatter accumulates at the release point.

    This is [`variational.chatter_interruption`][] for use in a fit: it can be
    differentiated in forward mode with respect to all other parameters, and it returns
    NaN instead of raising an error if a step of the fit moves the interruption out of
    the bracket.

    Args:
        system: A system with two states, one constraint and a period.
        where: Selects the parameter.
        bracket: Two values of the parameter, well on either side of the published one,
            with complete chatter at only one of them.
        periods: Number of forcing periods from release to the release after sticking.

    Returns:
        The parameter, in its own unit; NaN if the bracket contains no interruption.

    Raises:
        ValueError: The system has no period.

    Examples:
        >>> from jaxcam.fitting import interruption_of_chattering
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=1.0, restitution=0.5)
        >>> value = interruption_of_chattering(system, lambda s: s.omega, (0.4, 0.8))
        >>> round(float(value), 4)
        0.6072
    """
    system = as_arrays(system)
    found = interruption_in(system, where, *bracket, periods)
    return jnp.where(found.converged, found.value, jnp.nan)
