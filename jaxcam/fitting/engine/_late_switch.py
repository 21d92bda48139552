"""Continue the motion of a piece across a switch that takes place near its end.

If the event of a piece moved beyond the end of the piece, the state at the end would
change abruptly. The next piece may therefore begin in the discrete state after the
switch: its motion is continued backwards from the switch to its own beginning.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ...hybrid import HybridSystem, SwitchedSystem
from ...hybrid.surface import OnSides, open_distances, resets
from ._constant import constant
from ._fly import runge_kutta
from ._model import augmented_field, filtered_channels, Model
from ._modes import discrete_state_of, sides_in, Surfaces, surfaces_in, turned


JUMP = 30.0
"""Cost of a piece that begins in a discrete state to which no event leads: that of a
sample whose residual is 5.5 standard deviations of the noise."""
# Distance from a surface, in standard errors, beyond which its cost grows only in
# proportion to the distance
_FAR = 100.0
# Steps of Newton's method
_NEWTON = 4


class Switches(NamedTuple):
    """The switches near the end of a piece, one for each surface."""

    delay: Float[Array, " k"]
    """Time of the switch after the end of the piece (s), shape `(k,)`; that of the
    search, if the motion does not switch there.
    """
    near: Bool[Array, " k"]
    """Whether the motion switches near the end of the piece, shape `(k,)`."""


class Follower(NamedTuple):
    """The state in which the next piece begins if a motion continues."""

    state: Float[Array, " s"]
    """The state."""
    missing: Float[Array, ""]
    """Distance from the surface at which the motion has to switch, in standard errors,
    or the square root of a large distance; zero if it switches near the end of the
    piece.
    """


def late_switches(
    model: Model, system: SwitchedSystem, t, x, negative, reach
) -> Switches:
    """Return the switches of a motion within the time `reach` of the end of a piece.

    The motion is continued on the sides at its end, without sliding, and with the
    measured input or drive at that time.

    **Arguments:** the system at time `t`, the state `(s,)` and the sides there.
    """
    side = OnSides(system, negative)

    def at(delay):
        distances, rates, _ = jax.vmap(lambda one: _moved(model, side, t, x, one))(
            delay
        )
        return jnp.diagonal(distances), jnp.diagonal(rates)

    def newton(_, delay):
        distance, rate = at(delay)
        return jnp.clip(delay - distance / _falling(rate), -reach, reach)

    begin = jnp.zeros(negative.shape)
    delay = jax.lax.fori_loop(0, _NEWTON, newton, begin)
    _, rate = at(delay)
    return Switches(delay, (jnp.abs(delay) < reach) & (rate < 0))


def leads_to(
    known: Surfaces, negative: Bool[Array, " k"]
) -> tuple[Bool[Array, "k k"], Int[Array, " k"]]:
    """Return the sides after a switch at each surface, and the discrete states; -1 for
    a surface at which the motion cannot switch.
    """
    one_each = jnp.eye(known.number, dtype=bool)
    after = jax.vmap(lambda ends: turned(known, negative, ends))(one_each)
    reached = jax.vmap(lambda row: discrete_state_of(known, row))(after)
    met = jnp.asarray(known.met)[discrete_state_of(known, negative)]
    return after, jnp.where(met, reached, -1)


def follower(
    model: Model, system: HybridSystem, t, end, before, first, reach, error
) -> Follower:
    """Return the state in which the next piece begins if a motion continues, and how
    far the motion is from the switch between the two pieces.

    Without a switch between them, the state is `end`.

    Args:
        model: The model.
        system: The system at time `t`.
        t: Time of the end of the piece (s).
        end: State there, shape `(s,)`.
        before: Index of the discrete state there; `None` if the system has only one.
        first: Index of the discrete state in which the next piece begins.
        reach: Largest delay of a switch (s).
        error: Standard errors of the state, shape `(s,)`.
    """
    if first is None:
        return Follower(end, jnp.zeros(()))
    assert isinstance(system, SwitchedSystem)
    size = end.shape[0] - len(filtered_channels(model))
    fixed, still, when, x = constant((model, system, t, end))
    known = surfaces_in(still, when, x[:size])
    negative = sides_in(known, still, when, x[:size], before)
    found = late_switches(fixed, still, when, x, negative, reach)
    after, reached = leads_to(known, negative)
    leads = reached == first
    which = _first_of(found, leads, reach)
    row, delay = np.arange(known.number) == which, found.delay[which]
    side = OnSides(system, negative)

    def distance_at(x, delay):
        distances, rates, moved = _moved(model, side, t, x, delay)
        return jnp.sum(jnp.where(row, distances, 0.0)), (rates, moved)

    distance, (rates, moved) = distance_at(end, delay)
    rate = jax.lax.stop_gradient(jnp.sum(jnp.where(row, rates, 0.0)))
    near, jumps = jnp.any(leads & found.near), before != first
    later = jnp.where(near, -distance / _falling(rate), 0.0)
    at = t + delay + later
    moved = moved + later * augmented_field(model, side, t + delay, moved)
    rows = resets(side, at, moved[:size])
    landed = jnp.sum(jnp.where(row[:, None], rows, 0.0), axis=0)
    moved = jnp.concatenate([landed, moved[size:]])
    switched = OnSides(system, after[which])
    begun = runge_kutta(model, lambda t: switched, at, moved, t - at)[0]
    slope = jax.lax.stop_gradient(jax.grad(lambda x: distance_at(x, delay)[0])(x))
    unit = jnp.sqrt(jnp.sum((slope * error) ** 2))
    # a guard that depends on the time alone has no standard error
    known_error = jnp.any(leads) & (unit > 0)
    missing = distance / jnp.where(known_error, unit, 1.0)
    # a switch that the model cannot have must not outweigh all samples
    missing = missing / (1 + (missing / _FAR) ** 2) ** 0.25
    missing = jnp.where(known_error, missing, jnp.sqrt(JUMP))
    return Follower(
        jnp.where(jumps & jnp.any(leads), begun, end),
        jnp.where(jumps & ~near, missing, 0.0),
    )


def delay_of_switch(
    model: Model, system: SwitchedSystem, t, end, negative, first, reach
) -> Float[Array, ""]:
    """Return the delay of the switch to the discrete state `first` after the end of a
    piece (s), or minus infinity if the motion does not switch near it.

    **Arguments:** as for `late_switches`.
    """
    known = surfaces_in(system, t, end[: end.shape[0] - len(filtered_channels(model))])
    found = late_switches(model, system, t, end, negative, reach)
    leads = leads_to(known, negative)[1] == first
    which = _first_of(found, leads, reach)
    there = jnp.any(leads & found.near)
    return jnp.where(there, found.delay[which], -jnp.inf)


def _first_of(found: Switches, leads: Bool[Array, " k"], reach) -> Int[Array, ""]:
    """Return the surface of the first of several possible switches."""
    away = jnp.where(found.near, jnp.abs(found.delay), 2 * reach)
    return jnp.argmin(jnp.where(leads, away, jnp.inf))


def _moved(model: Model, side: OnSides, t, x, delay):
    """Return the distances from the surfaces after a delay, their rates of change, and
    the state.
    """
    size = x.shape[0] - len(filtered_channels(model))
    state = runge_kutta(model, lambda t: side, t, x, delay)[0]
    along = jnp.ones_like(t), augmented_field(model, side, t + delay, state)[:size]
    distances, rates = jax.jvp(
        lambda s, y: open_distances(side, s, y), (t + delay, state[:size]), along
    )
    return distances, rates, state


def _falling(rate):
    """Return the rate of a distance that falls; otherwise minus infinity."""
    return jnp.where(rate < 0, rate, -jnp.inf)
