"""From one impact to the next, exact to rounding however low the impact."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxcam import HybridSystem
from jaxcam.hybrid import (
    contact_state,
    normal_acceleration,
    normal_directions,
    normal_velocity,
)

from ._free_flight import flight_rates, MOST_STEPS, runge_kutta_step, TOLERANCE
from ._scalar import as_arrays, one_constraint


# a dip of the gap is looked for within one step: it must not hold two of them
_STEPS_PER_PERIOD = 16
_GAUSS, _GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(8)
_GAUSS, _GAUSS_WEIGHTS = (_GAUSS + 1) / 2, _GAUSS_WEIGHTS / 2


class ImpactPoint(eqx.Module):
    """Just after an impact."""

    #: time of the impact
    time: Float[Array, "..."]
    #: (n,) state after it
    state: Float[Array, "... n"]
    #: normal velocity after it, > 0; known better than the state's own
    speed: Float[Array, "..."]
    #: normal velocity before it, < 0
    approach: Float[Array, "..."]
    #: whether there was one before the horizon
    found: Bool[Array, "..."]


def next_impact(
    system: HybridSystem, time, state, speed, horizon, height: ArrayLike = 0.0
) -> ImpactPoint:
    """The next impact of a motion that leaves the surface, and the state after it.

    Pure; may be compiled, batched and differentiated forward, also twice.

    **Arguments:**

    - `system`: with one constraint, already `prepared`.
    - `time`, `state`: on the surface, after an impact or at release; shape `(n,)`.
    - `speed`: normal velocity there, >= 0 (0 at release).
    - `horizon`: how long to wait for an impact, in units of time.
    - `height`: gap at the start, > 0 for a motion that is already in flight; `speed`
      may then have either sign.

    **Returns:** a [`variational.ImpactPoint`][].
    """
    n = state.shape[0]
    time = jnp.asarray(time, jnp.float64)
    frozen = jax.lax.stop_gradient

    rates = flight_rates(system, time, speed, n)

    def velocity(y):
        return speed + y[n]

    period = system.period
    longest = horizon if period is None else period / _STEPS_PER_PERIOD
    longest = frozen(jnp.minimum(jnp.asarray(longest, jnp.float64), horizon))
    pull = -normal_acceleration(system, time, state)[0]
    # a parabola returns after 2 u / pull
    parabola = 1.2 * speed / jnp.where(pull > 0, pull, 1.0)
    short = (pull > 0) & (speed > 0)
    first = frozen(jnp.where(short, jnp.minimum(parabola, longest), longest / 8))

    def lowest(s, y, h, share):
        """Length of the step at which the gap is lowest, where v rises through 0."""

        def newton(_, length):
            end, _ = runge_kutta_step(rates, s, y, length)
            pull = rates(s + length, end)[n]
            moved = length - velocity(end) / jnp.where(pull > 0, pull, jnp.inf)
            return jnp.clip(moved, 0.0, h)

        length = jax.lax.fori_loop(0, 8, newton, share * h)
        return length, runge_kutta_step(rates, s, y, length)[0][-1]

    def look(carry):
        s, y, h, _, count = carry
        end, error = runge_kutta_step(rates, s, y, h)
        size = jnp.max(jnp.abs(error) / (TOLERANCE * (1 + jnp.abs(end))))
        good = size <= 1
        dips = good & (velocity(y) < 0) & (velocity(end) > 0) & (end[-1] > 0)
        fall, rise = velocity(y), velocity(end)
        share = fall / jnp.where(dips, fall - rise, -1.0)
        bottom, depth = jax.lax.cond(
            dips, lambda: lowest(s, y, h, share), lambda: (h, end[-1])
        )
        hit = good & (depth < 0)
        factor = 0.9 * jnp.maximum(size, 1e-12) ** -0.125
        grown = jnp.minimum(h * jnp.clip(factor, 0.2, 2.0), longest)
        moves = good & ~hit
        return (
            jnp.where(moves, s + h, s),
            jnp.where(moves, end, y),
            frozen(jnp.where(hit, bottom, grown)),
            hit,
            count + 1,
        )

    def searching(carry):
        s, _, _, hit, count = carry
        return ~hit & (s < horizon) & (count < MOST_STEPS)

    y = jnp.concatenate([state, jnp.zeros(1), jnp.asarray(height, jnp.float64)[None]])
    begin = (jnp.zeros(()), y, first, jnp.asarray(False), 0)
    s, y, h, found, _ = jax.lax.while_loop(searching, look, begin)

    # z / (time since the impact) has no root at the impact itself
    def refine(carry):
        low, high, guess, _, count = carry
        end, _ = runge_kutta_step(rates, s, y, guess)
        elapsed = s + guess
        value = end[-1] / elapsed
        slope = (velocity(end) - value) / elapsed
        low = jnp.where(value > 0, guess, low)
        high = jnp.where(value > 0, high, guess)
        moved = guess - value / jnp.where(slope < 0, slope, -jnp.inf)
        inside = (moved > low) & (moved < high)
        moved = jnp.where(inside & (slope < 0), moved, (low + high) / 2)
        return low, high, moved, jnp.abs(moved - guess), count + 1

    def unsettled(carry):
        _, high, guess, change, count = carry
        return (change > 4e-16 * (s + guess)) & (count < 100) & found

    start = (jnp.zeros(()), h, h, h, 0)
    _, _, length, _, _ = jax.lax.while_loop(unsettled, refine, start)
    length = frozen(length)

    # two more steps of Newton carry first and second derivatives
    def newton(_, carry):
        _, _, length = carry
        end, _ = runge_kutta_step(rates, s, y, length)
        fall = velocity(end)
        moved = length - end[-1] / jnp.where(fall < 0, fall, -jnp.inf)
        return end, length, moved

    end, length, _ = jax.lax.fori_loop(0, 3, newton, (y, length, length))
    arrival = time + (s + length)
    before, approach = end[:n], velocity(end)
    after = one_constraint(system.impact(arrival, before), 1)
    return ImpactPoint(
        time=arrival,
        state=after,
        speed=rebound_speed(system, arrival, before, approach),
        approach=approach,
        found=found,
    )


def rebound_speed(system: HybridSystem, time, before, approach):
    """Speed after an impact, to the relative accuracy of the speed before it.

    The difference of two nearly equal velocities would not do for slow impacts; there
    the law is integrated from the impact without speed.
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
    """P_I: time and rebound speed of an impact to those of the next. (6.10)

    Exact, where (6.10) is its first order at small speed. The rebound speed is the
    normal velocity after the impact; the thesis' v is that before it.

    **Arguments:** a system with two states and one constraint; `time`; `speed` >= 0 in
    the units of the gap over time; `horizon`, the longest wait (a period by default).

    **Returns:** time and rebound speed of the next impact; NaN where there is none.
    """
    system = as_arrays(system)
    time = jnp.asarray(time, jnp.float64)
    speed = jnp.asarray(speed, jnp.float64)
    horizon = system.period if horizon is None else horizon
    return _impact_map(system, time, speed, jnp.asarray(horizon, jnp.float64))


@eqx.filter_jit
def _impact_map(system, time, speed, horizon):
    system = system.prepared()
    state = surface_state(system, time, speed)
    point = next_impact(system, time, state, speed, horizon)
    return (
        jnp.where(point.found, point.time, jnp.nan),
        jnp.where(point.found, point.speed, jnp.nan),
    )


def impact_jacobian(system: HybridSystem, time, speed) -> Float[Array, "2 2"]:
    """Derivative of P_I by time and rebound speed. (6.11)-(6.12)

    Its determinant is r^2 v0/v1 times the change of phase volume in flight; it is
    singular where the next impact grazes, v1 = 0.
    """
    time = jnp.asarray(time, jnp.float64)
    speed = jnp.asarray(speed, jnp.float64)
    return jax.jacfwd(lambda y: jnp.stack(impact_map(system, y[0], y[1])))(
        jnp.stack([time, speed])
    )


def surface_state(system: HybridSystem, time, speed, guess=None):
    """State on the surface with normal velocity `speed`, shape `(2,)`.

    **Arguments:** a system with two states and one constraint, scalars `time` and
    `speed`, and a state to start Newton's method from (zeros by default).
    """
    guess = jnp.zeros(2) if guess is None else guess
    rest = contact_state(system, time[None], guess)[0]
    return rest + speed * normal_directions(system, time, rest)[0]
