"""The modes of a switched system in a fit: sides of its surfaces, and sliding."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ...hybrid import HybridSystem, SwitchedSystem
from ...hybrid.loop import jumping_components
from ...hybrid.surface import (
    beyond_shares,
    hold_of,
    InMode,
    Jumps,
    OnSides,
    open_distances,
    resets,
    slack_of_hold,
    surfaces,
    switching_distances,
)


# An estimated slip velocity may actually be zero if it is below this fraction of the
# change that friction can cause within a piece
_STOPPED = 0.01


class Mode(NamedTuple):
    """The side of each surface, and whether the motion slides on it, `(k,)` each."""

    negative: Bool[Array, " k"]
    sliding: Bool[Array, " k"]


class Surfaces(NamedTuple):
    """Properties of a switched system that follow from its structure."""

    number: int
    jumps: Jumps
    """The components of the field that change at each surface."""
    remembered: Int[np.ndarray, "d k"]
    """The sides that depend on the past, in each discrete state, shape `(d, k)`."""
    met: Bool[np.ndarray, "d k"]
    """The surfaces that a motion can cross in each discrete state, shape `(d, k)`."""
    changed: Bool[np.ndarray, "k k"]
    """The sides that change at the crossing of each surface, shape `(k, k)`."""
    transitions: Bool[np.ndarray, " k"]
    """Which surfaces are transitions between modes, shape `(k,)`."""

    def within(self, system: HybridSystem, mode: Mode) -> InMode:
        """Return the system in one mode, without contacts."""
        assert isinstance(system, SwitchedSystem)
        none = jnp.zeros((0,), dtype=bool)
        return InMode(system, mode.negative, mode.sliding, none, self.jumps)


def surfaces_in(system: HybridSystem, t, x) -> Surfaces:
    """Return the number of surfaces, and the components of the vector field that change
    at each of them.
    """
    assert isinstance(system, SwitchedSystem)
    values, static = eqx.partition(system, eqx.is_inexact_array)
    shapes, time, state = jax.eval_shape(lambda *a: a, values, t, x)
    number = jax.eval_shape(lambda s, y: surfaces(system, s, y), time, state).shape[0]
    jumps = jumping_components(static, shapes, time, state, number)
    changed = np.zeros((number, number), dtype=bool)
    for row, places in zip(changed, system.sides_changed(number), strict=True):
        row[list(places)] = True
    transitions = np.arange(number) < system.one_way
    remembered = system.remembered_sides(number)
    met = system.met_surfaces(number)
    return Surfaces(number, jumps, remembered, met, changed, transitions)


def sides_in(known: Surfaces, system: SwitchedSystem, t, x, discrete):
    """Return whether a motion in a discrete state is on the negative side of each
    surface, shape `(k,)`. Without a discrete state, the system determines all sides.
    """
    negative = system.sides(t, x) < 0
    if discrete is None:
        return negative
    row = jnp.asarray(known.remembered)[discrete]
    # without hysteresis, the state determines the side
    row = jnp.where(_instant(system, known.number), 0, row)
    return jnp.where(row == 0, negative, row < 0)


def discrete_state_of(known: Surfaces, negative: Bool[Array, " k"]) -> Int[Array, ""]:
    """Return the index of the discrete state that a motion on these sides has."""
    rows = known.remembered
    same = (rows == 0) | ((rows < 0) == negative[None])
    return jnp.argmax(jnp.all(same, axis=-1))


def _instant(system: SwitchedSystem, number: int) -> Bool[Array, " k"]:
    """Return which surfaces, transitions excepted, have no hysteresis."""
    hysteresis = jnp.broadcast_to(jnp.asarray(system.hysteresis), (number,))
    return (hysteresis <= 0) & (jnp.arange(number) >= system.one_way)


def first_mode(
    known: Surfaces, system: HybridSystem, t, x, duration, discrete=None
) -> Mode:
    """Return the mode in which a piece of a motion starts.

    While friction holds a body at rest, the motion slides along the surface of zero
    slip. If kinetic friction can hold the body, this sliding begins in the first step.
    Under a larger load, which only static friction can hold, the motion slides from the
    start if its slip is small compared with the change that friction can cause.

    Args:
        known: The surfaces.
        system: The system.
        t: Time (s).
        x: State, shape `(n,)`; a velocity that is zero may have an error.
        duration: Duration of the piece (s).
        discrete: Index of the discrete state, if it is known; otherwise the system
            determines it.

    Returns:
        The mode.
    """
    assert isinstance(system, SwitchedSystem)
    negative = sides_in(known, system, t, x, discrete)
    free = Mode(negative, jnp.zeros_like(negative))
    slidable = [bool(changed) for changed in known.jumps.free]
    if not any(slidable):
        return free
    height, rate = _open_along(OnSides(system, negative), t, x)
    _, beyond = _open_along(OnSides(system, ~negative), t, x)
    change = jnp.abs(rate + beyond) * duration
    near = jnp.array(slidable) & (jnp.abs(height) <= _STOPPED * change)
    held, _ = hold_of(known.within(system, Mode(negative, near)), t, x)
    slack = slack_of_hold(OnSides(system, negative))
    return Mode(negative, near & (held <= 0) & (slack > 0))


def on_side_of(system: HybridSystem, t, x, discrete=None) -> HybridSystem:
    """Return a system whose field is smooth near a state: the branch on the side of the
    surfaces on which the state lies, in a discrete state if one is given.
    """
    if not isinstance(system, SwitchedSystem):
        return system
    given = jax.lax.stop_gradient((t, x))
    if discrete is None:
        return OnSides(system, system.sides(*given) < 0)
    known = surfaces_in(system, *given)
    return OnSides(system, sides_in(known, system, *given, discrete))


def distances_along(system: InMode, t, x, rate):
    """Return the switching distances `(k,)`, and their rates of change if `x` changes
    at `rate`.
    """
    along = jnp.ones_like(t), rate
    return jax.jvp(lambda s, y: switching_distances(system, s, y), (t, x), along)


def _open_along(system: OnSides, t, x):
    """Return the distances `(k,)` of a motion that does not slide from the surfaces,
    and their rates of change.

    Unlike those of sliding, these distances do not depend on the vector field, so that
    a program contains it only once.
    """

    def distances(s, y):
        return open_distances(system, s, y)

    along = jnp.ones_like(t), system.vector_field(t, x)
    return jax.jvp(distances, (t, x), along)


def state_after(system: InMode, t, x, ends: Bool[Array, " k"]) -> Float[Array, " n"]:
    """Return the state after the event at one surface; it is reset if the event is a
    crossing.
    """
    rows = resets(OnSides(system.system, system.negative), t, x)
    landed = jnp.sum(jnp.where(ends[:, None], rows, 0.0), axis=0)
    return jnp.where(jnp.any(ends & ~system.sliding), landed, x)


def mode_after(
    known: Surfaces, system: InMode, t, x, after, ends: Bool[Array, " k"]
) -> Mode:
    """Return the mode after the event at one surface.

    A crossing changes the side; if the vector field beyond the surface points back to
    it, the motion slides. When sliding ends, the motion continues on the side whose
    weight has reached one.

    Args:
        known: The surfaces.
        system: The system in its mode before the event.
        t: Time of the event (s).
        x: State before the event, shape `(n,)`.
        after: State after the event, shape `(n,)`.
        ends: Whether each surface is the one at which the event occurs, shape `(k,)`.

    Returns:
        The mode.
    """
    slidable = [bool(changed) for changed in known.jumps.free]
    slid = system.sliding & ends
    if not any(slidable):
        return Mode(turned(known, system.negative, ends), system.sliding)
    turns = ends & (~slid | (beyond_shares(system, t, x) > 0.5))
    left = Mode(turned(known, system.negative, turns), system.sliding & ~ends)
    _, before = _open_along(system, t, x)
    _, rate = _open_along(known.within(system.system, left), t, after)
    # static friction stops a motion that kinetic friction would not reverse
    slack = slack_of_hold(system)
    back = rate <= jnp.maximum(-before, 0.0) * slack / (1 + slack)
    # with hysteresis, the other threshold is a finite distance away, so the motion does
    # not slide
    apart = jnp.broadcast_to(jnp.asarray(system.system.hysteresis), back.shape) > 0
    arrives = ends & ~slid & back & ~apart & jnp.array(slidable)
    return Mode(left.negative, left.sliding | arrives)


def turned(known: Surfaces, negative, turns: Bool[Array, " k"]) -> Bool[Array, " k"]:
    """Return the flags of the negative sides after crossings of surfaces."""
    changed = jnp.any(turns[:, None] & jnp.asarray(known.changed), axis=0)
    return negative ^ changed
