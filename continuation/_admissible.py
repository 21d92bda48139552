"""Whether an orbit is one: no penetration of a constraint anywhere on it."""

from typing import Any, TYPE_CHECKING

import equinox as eqx
import jax.numpy as jnp


if TYPE_CHECKING:
    from ._shooting import ImpactingOrbits


#: names of the monitors: lowest gap within flight k, approach speed of impact k
DIP = "gap of flight"
IMPACT = "speed of impact"
#: a gap below this (relative to the largest of the orbit) is a penetration; it is what
#: rounding and the equations' tolerance leave of a gap of zero
ROUNDING = 1e-9


def inadmissible(problem: "ImpactingOrbits", point: Any) -> str | None:
    """Why the orbit at a point is none, or None."""
    return reason_against(problem, point.tests, point.observed)


@eqx.filter_jit
def look(problem, u, parameters):
    """Monitors and observed quantities, compiled."""
    return problem.seen(u, parameters)


def refuse(problem: "ImpactingOrbits", u, parameters) -> str | None:
    """Why a solution of the equations is no orbit, or None."""
    return reason_against(problem, *look(problem, jnp.asarray(u), parameters))


def reason_against(problem, monitors, observed) -> str | None:
    """Why a solution is no orbit, from what has been seen of it."""
    for name, value in monitors.items():
        value = float(value)
        where = name.rsplit(" ", 1)[-1]
        if name.startswith(IMPACT) and not value >= -ROUNDING:
            return (
                f"impact {where} moves away from its constraint: the orbit would have "
                "to start its flight inside it"
            )
        if name.startswith(DIP) and not value >= -ROUNDING:
            return (
                f"the gap falls to {value:.1e} within flight {where}: the orbit "
                "would go through the constraint"
            )
    wrong = float(observed["integration error"])
    if not wrong < 1e-9:
        return (
            f"{problem.steps} steps in a flight leave an error of {wrong:.0e}; state "
            "the problem with more steps"
        )
    return None
