"""Compute the derivative of the flow over a period by two independent methods."""

from typing import Literal

from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem, Settings, SwitchedSystem
from jaxcam.parameters import as_arrays, pick, Where

from ._builder import picked
from ._orbit import Orbit
from ._turn_derivative import by_flow, by_product, TurnDerivative


Method = Literal["product", "flow"]


def monodromy(
    system: HybridSystem,
    orbit: Orbit,
    *,
    method: Method = "product",
    settings: Settings | None = None,
) -> Float[Array, "n n"]:
    """Return the monodromy matrix, the derivative of the state after one period with
    respect to the initial state.

    Args:
        system: The system.
        orbit: The orbit, from [`variational.orbit_of`][] or
            `continuation.periodic_orbit`.
        method: "product" multiplies the transition matrices of the flights and the
            saltation matrices of the recorded events; "flow" differentiates the event
            loop. The first is accurate at every impact speed; the second loses one
            digit per decade of decreasing impact speed, because it has to locate the
            impacts again. With switching surfaces, "flow" is always used.
        settings: Accuracy of the method "flow"; the default tolerance is 1e-12.

    Returns:
        Shape `(n, n)`.

    Examples:
        >>> import continuation, variational
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> variational.monodromy(system, orbit).shape
        (2, 2)
    """
    made = turn_derivative(system, orbit, method=method, settings=settings)
    return made.state


def turn_derivative(
    system: HybridSystem,
    orbit: Orbit,
    where: Where | None = None,
    *,
    method: Method = "product",
    settings: Settings | None = None,
) -> TurnDerivative:
    """Return the derivatives of the state after one period with respect to the initial
    state, period, phase and parameters.

    The period is held fixed when the parameters change; if the forcing period depends
    on them, add the field `period` of the result times the derivative of the forcing
    period.

    Args:
        system: The system.
        orbit: The periodic orbit.
        where: Selects one or more parameters of the system, as for
            [`jaxcam.parameters.pick`][]; default: none.
        method: As for [`variational.monodromy`][].
        settings: Accuracy of the method "flow"; the default tolerance is 1e-12.

    Returns:
        A [`variational.orbits.TurnDerivative`][].

    Raises:
        ValueError: `method` is unknown.

    Examples:
        >>> import continuation, variational
        >>> from jaxcam.models import ImpactOscillator
        >>> system = ImpactOscillator(omega=2.8, restitution=0.8, wall=-0.5)
        >>> orbit = continuation.periodic_orbit(system, guess=[-0.8, 1.0])
        >>> variational.turn_derivative(system, orbit, "wall").parameters.shape
        (2, 1)
    """
    if method not in ("product", "flow"):
        raise ValueError(f'method is {method!r}; choose "product" or "flow"')
    system = as_arrays(system)
    where = None if where is None else pick(where, system)
    values = picked(system, where)
    if method == "product" and not isinstance(system, SwitchedSystem):
        return by_product(
            system, values, where, orbit.state, orbit.pieces, orbit.sticks
        )
    settings = Settings(tolerance=1e-12) if settings is None else settings
    at = orbit.state, orbit.time, orbit.period
    return by_flow(system, values, where, *at, settings, orbit.sticks)
