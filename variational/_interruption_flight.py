"""Flight after flight from release on, one Runge-Kutta step at a time.

One step is the same program whether it searches for the next impact, lands on it or
looks for the lowest point of a flight; so a loop over steps is small to compile, and
its forward derivative is that of the motion at fixed lengths of the steps, corrected
where it lands.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxcam import HybridSystem
from jaxcam.hybrid import normal_acceleration

from ._free_flight import runge_kutta_step, TOLERANCE
from ._impact_map import rebound_speed
from ._scalar import one_constraint


# a dip of the gap is looked for within one step: it must not hold two of them
_STEPS_PER_PERIOD = 16
# change of a landing step, over the flight and over the time in which the
# acceleration would stop the fall, after which one more step is exact
_LAST_CHANGE = 1e-3
# steps towards a landing or a lowest point, before the last is taken for it
_LANDINGS, _LOWERINGS = 100, 8

_SEARCH, _LAND, _LAST, _BOTTOM = range(4)
#: lengths of steps and decisions carry no derivative
frozen = jax.lax.stop_gradient


def nothing() -> tuple[Float[Array, ""], Int[Array, ""], Bool[Array, ""]]:
    """Zero, none and no, as the scalars that a loop carries."""
    return jnp.zeros(()), jnp.asarray(0), jnp.asarray(False)


def period_of(system: HybridSystem) -> Float[Array, ""]:
    """Forcing period (s), as the float that a loop carries."""
    return jnp.asarray(system.period, jnp.float64)


class Flight(NamedTuple):
    """Where the motion is, and what the next step is for."""

    time: Float[Array, ""]
    #: state, normal velocity and gap: the last two are integrated beside the state from
    #: the last impact on, so that low flights are as exact as high ones
    y: Float[Array, " n+2"]
    #: time of the last impact
    since: Float[Array, ""]
    #: of the next step
    length: Float[Array, ""]
    mode: Int[Array, ""]
    #: lengths before and behind what is looked for
    low: Float[Array, ""]
    high: Float[Array, ""]
    #: steps for the same purpose
    tries: Int[Array, ""]
    #: whether the flight has just passed its lowest point
    rises: Bool[Array, ""]


def leave(system: HybridSystem, time, state) -> Flight:
    """The start of a flight at release, without relative velocity."""
    zero, none, no = nothing()
    return Flight(
        time=time,
        y=jnp.concatenate([state, jnp.zeros(2)]),
        since=frozen(time),
        length=_longest(system) / 8,
        mode=none,
        low=zero,
        high=zero,
        tries=none,
        rises=no,
    )


def step(system: HybridSystem, f: Flight) -> tuple[Flight, Bool[Array, ""]]:
    """One step, and whether it ends in an impact: the motion is then just before it."""

    def rates(t, y):
        x, velocity = y[:-2], y[-2:-1]
        push = normal_acceleration(system, t, x)
        return jnp.concatenate([system.vector_field(t, x), push, velocity])

    end, wrong = runge_kutta_step(rates, f.time, f.y, f.length)
    rate = rates(f.time + f.length, end)
    # the landing moves with the motion: zero, but for its derivative
    late = end[-1] / jnp.where(frozen(end[-2]) < 0, end[-2], -jnp.inf)
    lands = (f.mode == _LAST) | ((f.mode == _LAND) & (f.tries >= _LANDINGS))
    there = end - late * rate
    moved, taken = _next(system, f, *frozen((end, wrong, rate)))
    return (
        moved._replace(
            time=jnp.where(
                lands,
                f.time + f.length - late,
                jnp.where(taken, f.time + f.length, f.time),
            ),
            y=jnp.where(lands, there, jnp.where(taken, end, f.y)),
        ),
        lands,
    )


def _next(system, f: Flight, end, wrong, rate) -> tuple[Flight, Bool[Array, ""]]:
    """What the next step is for, and how long; whether this one is taken."""
    size = jnp.max(jnp.abs(wrong) / (TOLERANCE * (1 + jnp.abs(end))))
    fall, rise, gap, pull = frozen(f.y[-2]), end[-2], end[-1], rate[-2]
    searches, bottoms = f.mode == _SEARCH, f.mode == _BOTTOM
    good = ~searches | (size <= 1)

    # landing, where a parabola through the end of the step does
    enters = good & (gap < 0) & (searches | bottoms)
    landing = enters | (f.mode == _LAND)
    falls = (rise < 0) & (rise * rise > 2 * pull * gap)
    root = jnp.sqrt(jnp.where(falls, rise * rise - 2 * pull * gap, 0.0))
    change = -2 * gap / jnp.where(falls, rise - root, 1.0)
    low = jnp.where(landing & (gap > 0), f.length, jnp.where(enters, 0.0, f.low))
    high = jnp.where(landing & (gap <= 0), f.length, f.high)
    towards = f.length + change
    falls &= (towards > low) & (towards < high)
    towards = jnp.where(falls, towards, (low + high) / 2)
    elapsed = frozen(f.time) + f.length - f.since
    least = jnp.minimum(elapsed * jnp.abs(pull), jnp.abs(rise))
    close = landing & falls & (jnp.abs(change * pull) <= _LAST_CHANGE * least)

    # the lowest point of a flight that may have gone below the surface within the step
    dips = searches & good & ~f.rises & (fall < 0) & (rise > 0) & (gap > 0)
    share = fall / jnp.where(dips, fall - rise, 1.0)
    lower = f.length - rise / jnp.where(pull > 0, pull, jnp.inf)
    lower = jnp.where(dips, f.length * share, jnp.clip(lower, 0.0, f.high))
    lowest = bottoms & ~enters & (f.tries >= _LOWERINGS)
    seeks = dips | (bottoms & ~enters & ~lowest)

    taken = (searches & good & ~enters & ~dips) | lowest
    factor = 0.9 * jnp.maximum(size, 1e-12) ** -0.125
    longest = _longest(system)
    grown = jnp.minimum(f.length * jnp.clip(factor, 0.2, 2.0), longest)
    grown = jnp.where(lowest, longest / 8, grown)

    mode = jnp.where(landing, _LAND, jnp.where(seeks, _BOTTOM, _SEARCH))
    again = (landing & ~enters) | (seeks & ~dips)
    return (
        f._replace(
            length=jnp.where(landing, towards, jnp.where(seeks, lower, grown)),
            mode=jnp.where(close, _LAST, mode),
            low=low,
            high=jnp.where(dips, f.length, high),
            tries=jnp.where(again, f.tries + 1, 0),
            rises=jnp.where(taken, lowest, f.rises),
        ),
        taken,
    )


def bounce(system: HybridSystem, f: Flight) -> Flight:
    """Just after the impact that the motion is just before."""
    x, approach = f.y[:-2], f.y[-2]
    after = one_constraint(system.impact(f.time, x), 1)
    speed = rebound_speed(system, f.time, x, approach)
    pull = -frozen(normal_acceleration(system, f.time, after)[0])
    # a parabola returns after 2 u / pull
    parabola = 2.2 * frozen(speed) / jnp.where(pull > 0, pull, 1.0)
    longest = _longest(system)
    return f._replace(
        y=jnp.concatenate([after, jnp.stack([speed, jnp.zeros_like(speed)])]),
        since=frozen(f.time),
        length=jnp.where(pull > 0, jnp.minimum(parabola, longest), longest / 8),
        mode=jnp.zeros_like(f.mode),
        tries=jnp.zeros_like(f.tries),
        rises=jnp.zeros_like(f.rises),
    )


def _longest(system):
    return frozen(period_of(system)) / _STEPS_PER_PERIOD
