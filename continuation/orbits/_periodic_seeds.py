"""Find initial orbits from many states of a sweep or a recording."""

import numpy as np
from jaxtyping import ArrayLike, Float

from jaxcam.hybrid import HybridSystem, Settings
from jaxcam.hybrid.sizes import component_sizes
from variational import Orbit

from ._periodic_orbit import periodic_orbit


def orbits_near(
    system: HybridSystem,
    states: Float[ArrayLike, "k n"],
    period: float | None = None,
    *,
    periods: int | None = None,
    t0: float = 0.0,
    settings: Settings | None = None,
    same: float = 1e-6,
) -> tuple[Orbit, ...]:
    """Return the distinct periodic orbits found from many guesses.

    The guesses are states at one phase of the forcing, such as the last points of a
    sweep, the attractors found by a basin computation, or samples of a recording
    (angles and their derivatives) taken once per period.

    Args:
        system: The system.
        states: States at `t0`, shape `(k, n)`.
        period: As for [`continuation.periodic_orbit`][].
        periods: As for [`continuation.periodic_orbit`][].
        t0: As for [`continuation.periodic_orbit`][].
        settings: As for [`continuation.periodic_orbit`][].
        same: Two orbits count as equal if their states at `t0` differ by less than this
            value, relative to [`jaxcam.hybrid.sizes.component_sizes`][].

    Returns:
        The orbits in the order in which they were found. Guesses from which Newton's
            method fails are omitted, so the tuple may be empty.

    Raises:
        ValueError: `states` has the wrong shape.

    Examples:
        >>> import continuation
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> guesses = jnp.array([[-0.8, 1.0], [-0.8, 1.01]])
        >>> len(continuation.orbits_near(system, guesses))
        1
    """
    states = np.asarray(states, dtype=float)
    if states.ndim != 2:
        raise ValueError(
            f"states has shape {states.shape}; pass one row for each guess, (k, n)"
        )
    found: list[Orbit] = []
    for state in states:
        if any(_passes(system, orbit, state, same) for orbit in found):
            continue
        try:
            orbit = periodic_orbit(
                system, state, period, periods=periods, t0=t0, settings=settings
            )
        except ValueError:
            continue
        there = np.asarray(orbit.state)
        if not any(_passes(system, other, there, same) for other in found):
            found.append(orbit)
    return tuple(found)


def _passes(system: HybridSystem, orbit: Orbit, state, same: float) -> bool:
    """Return whether an orbit starts at this state, to within the tolerance `same`."""
    current = np.asarray(orbit.state)
    sizes = component_sizes(system, orbit.time, current, orbit.period)
    return bool(np.all(np.abs(current - state) <= same * np.asarray(sizes)))
