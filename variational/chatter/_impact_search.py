"""Search for the next impact, one Runge-Kutta step at a time.

This is separate from the event loop of `jaxcam.hybrid`, because it computes gaps with
high relative accuracy and can be differentiated twice. A step is the same program
whether it searches for the next impact, ends at it or finds the lowest point of a
flight, so a loop over steps compiles quickly. The forward derivative of a step is that
of the motion with fixed step lengths, corrected at the impact.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jaxcam import HybridSystem
from jaxcam.hybrid.surface import normal_acceleration

from ._free_flight import flight_rates, on_flight, runge_kutta_step, TOLERANCE


# number of longest steps per forcing period, such that no step contains two minima of
# the gap
_STEPS_PER_PERIOD = 16
# if the landing time changes by less than this, relative to the flight time and to the
# time in which the acceleration would stop the approach, the next step is the last one
_LAST_CHANGE = 1e-3
# maximum numbers of steps towards a landing and towards a lowest point, after which the
# last step is accepted
_LANDINGS, _LOWERINGS = 100, 12

# length of the first step in units of speed / acceleration, slightly more than the 2 at
# which a parabola would land
_BEHIND = 2.2

_SEARCH, _LAND, _LAST, _BOTTOM = range(4)
frozen = jax.lax.stop_gradient
"""Return a value without its derivative, for step lengths and decisions."""


class SearchState(NamedTuple):
    """The state of the search: the motion, and the purpose of the next step."""

    time: Float[Array, ""]
    y: Float[Array, " n+2"]
    """State, normal velocity and gap; the last two are integrated separately, starting
    at the last impact, so that low flights are as accurate as high ones.
    """
    since: Float[Array, ""]
    """Time of the last impact."""
    length: Float[Array, ""]
    """Length of the next step."""
    longest: Float[Array, ""]
    """Longest step."""
    mode: Int[Array, ""]
    """Purpose of the next step: `_SEARCH`, `_LAND`, `_LAST` or `_BOTTOM`."""
    low: Float[Array, ""]
    """Length of a step that ends before the point that is searched for."""
    high: Float[Array, ""]
    """Length of a step that ends beyond that point."""
    tries: Int[Array, ""]
    """Number of steps taken so far for the same purpose."""
    rises: Bool[Array, ""]
    """Whether the flight has just passed its lowest point."""

    @property
    def searches(self) -> Bool[Array, ""]:
        """Return whether the next step is not aimed at an impact or a lowest point."""
        return self.mode == _SEARCH

    @property
    def lands(self) -> Bool[Array, ""]:
        """Return whether the next step ends at the impact, to within one correction."""
        return (self.mode == _LAST) | ((self.mode == _LAND) & (self.tries >= _LANDINGS))


def take_off(
    system: HybridSystem, time, state, speed, longest, height: ArrayLike = 0.0
) -> SearchState:
    """Return the start of a flight from an impact, from release, or from a `height`.

    `longest` is the longest step.
    """
    longest, time = frozen(longest), jnp.asarray(time, jnp.float64)
    pull = -frozen(normal_acceleration(system, time, state)[0])
    # a parabola returns after 2 speed / pull
    parabola = _BEHIND * frozen(speed) / jnp.where(pull > 0, pull, 1.0)
    short = (pull > 0) & (frozen(speed) > 0)
    return SearchState(
        time=time,
        y=on_flight(state, speed, height),
        since=frozen(time),
        length=jnp.where(short, jnp.minimum(parabola, longest), longest / 8),
        longest=longest,
        mode=jnp.asarray(_SEARCH),
        low=jnp.zeros(()),
        high=jnp.zeros(()),
        tries=jnp.asarray(0),
        rises=jnp.asarray(False),
    )


def longest_step(system: HybridSystem, horizon=jnp.inf) -> Float[Array, ""]:
    """Return the longest step: a fraction of the forcing period, but not more than the
    horizon.
    """
    if system.period is None:
        return jnp.asarray(horizon, jnp.float64)
    part = jnp.asarray(system.period, jnp.float64) / _STEPS_PER_PERIOD
    return jnp.minimum(part, horizon)


def search_step(
    system: HybridSystem, f: SearchState
) -> tuple[SearchState, Bool[Array, ""]]:
    """Return the state of the search after one step, and whether the step ends at an
    impact; the motion is then that before the rebound.
    """

    rates = flight_rates(system)
    end, wrong = runge_kutta_step(rates, f.time, f.y, f.length)
    rate = rates(f.time + f.length, end)
    # `late` is zero at a landing, but its derivative is not, because the time of the
    # landing depends on the motion
    late = end[-1] / jnp.where(frozen(end[-2]) < 0, end[-2], -jnp.inf)
    lands = f.lands
    there = end - late * rate
    moved, taken = _next(f, *frozen((end, wrong, rate)))
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


def _next(f: SearchState, end, wrong, rate) -> tuple[SearchState, Bool[Array, ""]]:
    """Return the purpose and length of the next step, and whether this one is
    accepted.
    """
    size = jnp.max(jnp.abs(wrong) / (TOLERANCE * (1 + jnp.abs(end))))
    fall, rise, gap, pull = frozen(f.y[-2]), end[-2], end[-1], rate[-2]
    searches, bottoms = f.mode == _SEARCH, f.mode == _BOTTOM
    good = ~searches | (size <= 1)

    # to land, aim at the time at which a parabola from the end of this step lands
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

    # if the flight may have passed below the surface within the step, seek its lowest
    # point, between a time at which the gap decreases and one at which it increases
    dips = searches & good & ~f.rises & (fall < 0) & (rise > 0) & (gap > 0)
    share = fall / jnp.where(dips, fall - rise, 1.0)
    low = jnp.where(bottoms & ~enters & (rise < 0), f.length, jnp.where(dips, 0.0, low))
    high = jnp.where(dips | (bottoms & ~enters & (rise >= 0)), f.length, high)
    lower = f.length - rise / jnp.where(pull > 0, pull, jnp.inf)
    between = (pull > 0) & (lower >= low) & (lower <= high)
    lower = jnp.where(between, lower, (low + high) / 2)
    lower = jnp.where(dips, f.length * share, lower)
    lowest = bottoms & ~enters & (f.tries >= _LOWERINGS)
    seeks = dips | (bottoms & ~enters & ~lowest)

    taken = (searches & good & ~enters & ~dips) | lowest
    factor = 0.9 * jnp.maximum(size, 1e-12) ** -0.125
    grown = jnp.minimum(f.length * jnp.clip(factor, 0.2, 2.0), f.longest)
    grown = jnp.where(lowest, f.longest / 8, grown)

    mode = jnp.where(landing, _LAND, jnp.where(seeks, _BOTTOM, _SEARCH))
    again = (landing & ~enters) | (seeks & ~dips)
    return (
        f._replace(
            length=jnp.where(landing, towards, jnp.where(seeks, lower, grown)),
            mode=jnp.where(close, _LAST, mode),
            low=low,
            high=high,
            tries=jnp.where(again, f.tries + 1, 0),
            rises=jnp.where(taken, lowest, f.rises),
        ),
        taken,
    )
