"""Whether a solution of the shooting equations is an orbit: no penetration anywhere."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp

from jaxcam.hybrid import HybridSystem

from ._shooting import Shooting


# what rounding and the equations' tolerance leave of a gap or a speed of zero, in the
# units of the system: a gap that is lower is a penetration
_ROUNDING = 1e-9
# error of the flights up to which the gaps are believed
_ERROR = 1e-9


def inadmissible(
    gaps: Mapping[int, Any], speeds: Mapping[int, Any], error, steps: int
) -> str | None:
    """Why a solution is no orbit, or None.

    **Arguments:** lowest gap of each flight and approach speed of each impact, by their
    numbers, and the error of the flights, as in [`variational.orbits.Seen`][];
    Runge-Kutta steps in a flight.
    """
    for k, value in gaps.items():
        if not value >= -_ROUNDING:
            return (
                f"the gap falls to {value:.1e} within flight {k}: the orbit would go "
                "through the constraint"
            )
    for k, value in speeds.items():
        if not value >= -_ROUNDING:
            return (
                f"impact {k} moves away from its constraint: the orbit would have to "
                "start its flight inside it"
            )
    if not float(error) < _ERROR:
        return (
            f"{steps} steps in a flight leave an error of {float(error):.0e}; state "
            "the problem with more steps"
        )
    return None


def refuse(shooting: Shooting, u, system: HybridSystem) -> str | None:
    """Why a solution of the equations is no orbit, or None."""
    gaps, speeds, error = _look(shooting, jnp.asarray(u), system)
    gaps, speeds = (dict(enumerate(map(float, row))) for row in (gaps, speeds))
    return inadmissible(gaps, speeds, error, shooting.steps)


@eqx.filter_jit
def _look(shooting, u, system):
    seen = shooting.seen(u, system)
    return seen.gaps, seen.speeds, seen.error
