"""Check the admissibility of a solution of the shooting equations: no penetration."""

import math
from collections.abc import Mapping
from typing import Any

import jax.numpy as jnp

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.programs import program

from ._shooting import Shooting


# error of a zero gap or speed due to rounding and the tolerance of the equations,
# relative to the size of gaps; a gap below minus this value is a penetration
_ROUNDING = 1e-9
# largest error of the flights for which the gaps are reliable
_ERROR = 1e-9


def inadmissible(
    gaps: Mapping[int, Any],
    speeds: Mapping[int, Any],
    error: Any,
    *,
    gap_size: Any,
    period: Any,
    steps: int,
) -> str | None:
    """Return the reason why a solution is not admissible, or None.

    **Arguments:** lowest gap of each flight and approach speed of each impact, by
    index, the error of the flights and the size of the gaps, as in
    [`variational.orbits.Seen`][]; period (s); number of Runge-Kutta
    steps in a flight.
    """
    room = _ROUNDING * float(gap_size)
    for k, value in gaps.items():
        if not value >= -room:
            return (
                f"the gap falls to {value:.1e} within flight {k}: the orbit would pass "
                "through the constraint"
            )
    for k, value in speeds.items():
        if not value >= -room * 2 * math.pi / float(period):
            return (
                f"at impact {k}, the motion is away from the constraint: the flight "
                "before it would penetrate the constraint"
            )
    if not float(error) < _ERROR:
        return (
            f"with {steps} steps in a flight, the error is {float(error):.0e}; use "
            "more steps in the problem"
        )
    return None


def refuse(shooting: Shooting, u, system: HybridSystem) -> str | None:
    """Return the reason why a solution of the equations is not admissible, or None."""
    seen, period = _look(shooting, jnp.asarray(u), system)
    gaps, speeds = (
        dict(enumerate(map(float, row))) for row in (seen.gaps, seen.speeds)
    )
    return inadmissible(
        gaps,
        speeds,
        seen.error,
        gap_size=seen.gap_size,
        period=period,
        steps=shooting.steps,
    )


@program
def _look(shooting, u, system):
    return shooting.seen(u, system), shooting.period(u, system)
