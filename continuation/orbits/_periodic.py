"""Find the continuation problem solved by a given orbit."""

from typing import Any

from jaxtyping import ArrayLike, Float

from jaxcam.hybrid import HybridSystem, Settings, SwitchedSystem
from jaxcam.parameters import as_arrays
from variational import Orbit
from variational.orbits import seed

from ..problem import Start
from ._periodic_orbit import periodic_orbit
from ._periodic_sticking import on_release
from ._shooting import ImpactingOrbits
from ._single_shooting import SingleShooting


def periodic_orbits(
    system: HybridSystem,
    orbit: Orbit | Float[ArrayLike, " n"] | None = None,
    period: float | None = None,
    *,
    periods: int | None = None,
    beyond: bool = False,
) -> Start:
    """Return the start of a branch of periodic orbits: a problem and its solution.

    The problem depends on the motion: [`continuation.ImpactingOrbits`][] with the
    impacts of the orbit, [`continuation.StickingOrbits`][] if it sticks, or
    [`continuation.SingleShooting`][] if the system has switching surfaces.

    Args:
        system: The system.
        orbit: An orbit from [`continuation.periodic_orbit`][]. Otherwise, pass an
            initial guess of the state, or None, together with `period` or `periods`, as
            for that function.
        period: As for [`continuation.periodic_orbit`][].
        periods: As for [`continuation.periodic_orbit`][].
        beyond: For an orbit that sticks, whether to continue beyond the interruption of
            its chatter with the orbits that have finitely many impacts.

    Returns:
        A [`continuation.Start`][], for [`continuation.follow`][].

    Raises:
        ValueError: As for `periodic_orbit`, or for an orbit that sticks without
            forcing.

    Examples:
        >>> import continuation
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> type(continuation.periodic_orbits(system, orbit).problem).__name__
        'ImpactingOrbits'
    """
    system = as_arrays(system)
    if not isinstance(orbit, Orbit):
        orbit = periodic_orbit(system, orbit, period, periods=periods)
    base = None if system.period is None else float(system.period)
    length = float(orbit.period)
    number = 0 if base is None else round(length / base)
    if isinstance(system, SwitchedSystem):
        return SingleShooting.of(system, orbit, number, Settings(tolerance=1e-12))
    if orbit.sticks:
        if number == 0:
            raise ValueError(
                "this orbit sticks, but the system has no forcing; a branch of orbits "
                "that stick needs a forced system"
            )
        problem, state = on_release(system, number, beyond)
        return Start(problem, state)
    equations, u = seed(system, orbit, number)
    return Start(ImpactingOrbits.of(system, equations), u)


def start_of(system: Any, start: Any) -> Start:
    """Return the start of the branch that `follow(system, orbit, ...)` follows."""
    if isinstance(start, Start):
        return start
    if isinstance(start, Orbit) or start is None:
        return periodic_orbits(system, start)
    raise ValueError(
        "give the orbit to start from, found with continuation.periodic_orbit(system, "
        "guess, period), or None for the one to which the motion converges"
    )
