"""Whether a solution of the shooting equations is an orbit: no penetration anywhere."""

import equinox as eqx
import jax.numpy as jnp

from jaxcam.hybrid import HybridSystem

from ._shooting import Shooting


# what rounding and the equations' tolerance leave of a gap or a speed of zero, in the
# units of the system: a gap that is lower is a penetration
_ROUNDING = 1e-9
# error of the flights up to which the gaps are believed
_ERROR = 1e-9


def inadmissible(gaps, speeds, error, steps: int) -> str | None:
    """Why a solution is no orbit, or None.

    **Arguments:** lowest gap of each flight, approach speed of each impact, error of
    the flights, as in [`variational.orbits.Seen`][]; Runge-Kutta steps in a flight.
    """
    for k, value in enumerate(map(float, gaps)):
        if not value >= -_ROUNDING:
            return (
                f"the gap falls to {value:.1e} within flight {k}: the orbit would go "
                "through the constraint"
            )
    for k, value in enumerate(map(float, speeds)):
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
    return inadmissible(gaps, speeds, error, shooting.steps)


@eqx.filter_jit
def _look(shooting, u, system):
    seen = shooting.seen(u, system)
    return seen.gaps, seen.speeds, seen.error
