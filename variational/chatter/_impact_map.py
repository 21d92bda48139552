"""Map one impact to the next, accurate to rounding even for arbitrarily slow
impacts.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxcam import HybridSystem
from jaxcam.hybrid.lowering import while_loop
from jaxcam.hybrid.programs import program
from jaxcam.hybrid.surface import contact_state, normal_directions, normal_velocity
from jaxcam.parameters import as_arrays

from ._free_flight import flight_rates, runge_kutta_step
from ._impact_search import frozen, longest_step, search_step, take_off
from ._scalar import one_constraint


# maximum number of attempted steps
_MOST_STEPS = 4096
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(8)
_GAUSS, _GAUSS_WEIGHTS = (_GAUSS + 1) / 2, _GAUSS_WEIGHTS / 2


class ImpactPoint(eqx.Module):
    """The state just after an impact."""

    time: Float[Array, "..."]
    """Time of the impact (s)."""
    state: Float[Array, "... n"]
    """State after the impact, shape `(n,)`."""
    speed: Float[Array, "..."]
    """Normal velocity after the impact, > 0, more accurate than if computed from the
    state.
    """
    approach: Float[Array, "..."]
    """Normal velocity before the impact, < 0."""
    found: Bool[Array, "..."]
    """Whether there was an impact before the horizon."""


def next_impact(
    system: HybridSystem, time, state, speed, horizon, height: ArrayLike = 0.0
) -> ImpactPoint:
    """Return the next impact of a motion that leaves the surface, with the state after
    it.

    The function is pure: it can be compiled, batched and differentiated in forward
    mode, up to twice.

    Args:
        system: A system with one constraint, already `prepared`.
        time: Time of the start (s).
        state: State on the surface, after an impact or at release, shape `(n,)`.
        speed: Normal velocity at the start, >= 0 (0 at release).
        horizon: Longest flight time (s).
        height: Gap at the start, > 0 for a motion already in flight; `speed` may then
            have either sign.

    Returns:
        An [`variational.chatter.ImpactPoint`][].

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational.chatter import next_impact
        >>> ball, rebound = BouncingBall(), jnp.array([0.0, 0.981])
        >>> point = next_impact(ball, 0.0, rebound, speed=0.981, horizon=1.0)
        >>> round(float(point.time), 6), round(float(point.speed), 6)  # 2 v / g and r v
        (0.2, 0.7848)
    """
    time = jnp.asarray(time, jnp.float64)
    longest = longest_step(system, horizon)
    start = take_off(system, time, state, speed, longest, height)

    def searching(carry):
        f, count = carry
        waits = ~f.searches | (f.time - time < horizon)
        return ~f.lands & waits & (count < _MOST_STEPS)

    def look(carry):
        f, count = carry
        return search_step(system, f)[0], count + 1

    f, _ = while_loop(searching, look, (start, 0))
    rates = flight_rates(system)

    # the last steps of Newton's method carry the first and second derivatives
    def newton(_, carry):
        _, _, length = carry
        end, _ = runge_kutta_step(rates, f.time, f.y, length)
        moved = length - end[-1] / jnp.where(end[-2] < 0, end[-2], -jnp.inf)
        return end, length, moved

    length = frozen(f.length)
    end, length, _ = jax.lax.fori_loop(0, 4, newton, (f.y, length, length))
    arrival = f.time + length
    before, approach = end[:-2], end[-2]
    after = one_constraint(system.impact(arrival, before), 1)
    return ImpactPoint(
        time=arrival,
        state=after,
        speed=rebound_speed(system, arrival, before, approach),
        approach=approach,
        found=f.lands,
    )


def rebound_speed(system: HybridSystem, time, before, approach):
    """Return the speed after an impact, with the relative accuracy of the speed before
    it.

    For slow impacts, the difference of two nearly equal velocities would be inaccurate,
    so the derivative of the impact law is integrated from zero speed.
    """
    direction = normal_directions(system, time, before)[0]
    rest = before - approach * direction

    def after(v):
        moved = one_constraint(system.impact(time, rest + v * direction), 1)
        return normal_velocity(system, time, moved)[0]

    shares = jnp.asarray(_GAUSS) * approach
    slopes = jax.vmap(lambda v: jax.jvp(after, (v,), (jnp.ones_like(v),))[1])(shares)
    slow = approach * (jnp.asarray(_GAUSS_WEIGHTS) @ slopes)
    plain = after(approach)
    size = jnp.max(jnp.abs(jax.lax.stop_gradient(before)))
    return jnp.where(jnp.abs(approach) < 1e-3 * (1 + size), slow, plain)


def impact_map(system: HybridSystem, time, speed, *, horizon=None):
    """Map the time and rebound speed of an impact to those of the next (the map P_I).

    The map is exact; eq. 6.10 of the thesis is its first-order approximation at small
    speeds. The rebound speed is the normal velocity after the impact; v in the thesis
    is the normal velocity before the impact.

    Args:
        system: A system with two states and one constraint.
        time: Time of the impact (s).
        speed: Rebound speed, >= 0, in units of the gap per unit of time.
        horizon: Longest flight time (s); default: one period.

    Returns:
        Time and rebound speed of the next impact; NaN if there is none.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import impact_map
        >>> [round(float(x), 6) for x in impact_map(BouncingBall(), 0.0, 0.981)]
        [0.2, 0.7848]
    """
    system = as_arrays(system)
    time = jnp.asarray(time, jnp.float64)
    speed = jnp.asarray(speed, jnp.float64)
    horizon = system.period if horizon is None else horizon
    return _impact_map(system, time, speed, jnp.asarray(horizon, jnp.float64))


@program
def _impact_map(system, time, speed, horizon):
    system = system.prepared()
    state = surface_state(system, time, speed)
    point = next_impact(system, time, state, speed, horizon)
    return (
        jnp.where(point.found, point.time, jnp.nan),
        jnp.where(point.found, point.speed, jnp.nan),
    )


def impact_jacobian(system: HybridSystem, time, speed) -> Float[Array, "2 2"]:
    """Return the derivative of the impact map P_I with respect to time and rebound
    speed.

    With the coefficient of restitution r and the rebound speeds v0 and v1 of the two
    impacts, its determinant is r^2 v0/v1 times the change of phase volume in flight;
    the derivative is unbounded if the next impact grazes, v1 = 0 (thesis, eqs.
    6.11-6.12).

    Args:
        system: The system.
        time: Time of the impact (s).
        speed: Rebound speed, >= 0.

    Returns:
        The derivative, shape `(2, 2)`.

    Examples:
        >>> from jaxcam.models import BouncingBall
        >>> from variational import impact_jacobian
        >>> np.asarray(impact_jacobian(BouncingBall(), 0.0, 0.981)).round(4).tolist()
        [[1.0, 0.2039], [0.0, 0.8]]
    """
    time = jnp.asarray(time, jnp.float64)
    speed = jnp.asarray(speed, jnp.float64)
    return jax.jacfwd(lambda y: jnp.stack(impact_map(system, y[0], y[1])))(
        jnp.stack([time, speed])
    )


def surface_state(system: HybridSystem, time, speed, guess=None):
    """Return the state on the surface with normal velocity `speed`.

    Args:
        system: A system with two states and one constraint.
        time: Time (s).
        speed: Normal velocity, a scalar.
        guess: Initial guess for Newton's method; default: zeros.

    Returns:
        State, shape `(2,)`.

    Examples:
        >>> from jaxcam.models import ImpactOscillator
        >>> from variational.chatter import surface_state
        >>> surface_state(ImpactOscillator(wall=0.5), 0.0, speed=0.2).tolist()
        [0.5, -0.2]
    """
    time = jnp.asarray(time, jnp.float64)
    guess = jnp.zeros(2) if guess is None else guess
    rest = contact_state(system, time[None], guess)[0]
    return rest + speed * normal_directions(system, time, rest)[0]
