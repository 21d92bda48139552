"""Find the discrete state in which each piece of a recording begins.

The mode of an automaton and the side of a relay with hysteresis depend on the past, so
the state at the beginning of a piece does not determine them. Each discrete state is
tried for each piece. The most likely sequence of discrete states explains the samples,
and has few jumps: pieces that do not begin as the previous one ends.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from ...hybrid import SwitchedSystem
from ._constant import constant
from ._late_switch import delay_of_switch, JUMP, late_switches, leads_to
from ._model import DriveState, filtered_channels, Model
from ._modes import discrete_state_of, Surfaces, surfaces_in
from ._pieces import FLIGHT, FREE, Pieces
from ._switched_steps import Flight, switched_flight


class Ends(NamedTuple):
    """The discrete states at the ends of k pieces of a system with d such states."""

    last: Int[Array, " k"]
    """Index of the discrete state at the end, shape `(k,)`."""
    follows: Bool[Array, "k d"]
    """Whether the next piece may begin in each of the discrete states: in the last one,
    or in that after a switch near the end; shape `(k, d)`.
    """


def discrete_ends(model: Model, pieces: Pieces, states) -> Ends:
    """Return the discrete states at the ends of the pieces of one recording.

    **Arguments:** the model, the pieces with the discrete states in which they begin,
    and the states at their beginnings, `(k, s)`.
    """

    def piece(state, start, step, drive, begin):
        known, _ = _started(model, state, start, drive)
        end, mode, (stop, system) = _ended(
            model, pieces, state, start, step, drive, begin
        )
        last = discrete_state_of(known, mode.negative)
        near = late_switches(model, system, stop, end, mode.negative, pieces.reach)
        _, reached = leads_to(known, mode.negative)
        every = jnp.arange(len(known.remembered))
        switched = (reached[:, None] == every[None]) & near.near[:, None]
        switched = jnp.any(switched, axis=0) & ~jnp.any(mode.sliding)
        return Ends(last, switched | (every == last))

    part = pieces.flown
    inputs = states, part.start, part.step, pieces.drive, pieces.begins
    return jax.vmap(piece)(*constant(inputs))


def with_late_switches(
    model: Model, pieces: Pieces, states, least
) -> tuple[Float[Array, "k s"], Int[Array, " k"]]:
    """Return the states and discrete states at the beginnings of the pieces, after each
    piece whose switch takes place more than `least` (s) after its beginning has been
    made to begin before this switch.

    **Arguments:** as for `discrete_ends`.
    """

    def piece(state, start, step, drive, begin, following):
        known, _ = _started(model, state, start, drive)
        end, mode, (stop, system) = _ended(
            model, pieces, state, start, step, drive, begin
        )
        last = discrete_state_of(known, mode.negative)
        given = model, system, stop, end, mode.negative, following, pieces.reach
        late = (last != following) & (delay_of_switch(*given) > least)
        return end, last, late & ~jnp.any(mode.sliding)

    part = pieces.flown
    first = jnp.asarray(pieces.begins)
    following = jnp.concatenate([first[1:], first[-1:]])
    inputs = states, part.start, part.step, pieces.drive, first, following
    end, last, late = jax.vmap(piece)(*inputs)
    late = late[:-1] & (jnp.asarray(pieces.joint)[1:] == FLIGHT)
    moved = jnp.where(late[:, None], end[:-1], states[1:])
    return (
        jnp.concatenate([states[:1], moved]),
        jnp.concatenate([first[:1], jnp.where(late, last[:-1], first[1:])]),
    )


def _ended(model: Model, pieces: Pieces, state, start, step, drive, begin):
    """Return the state and the mode at the end of a piece, and its time and system."""
    given = model, state, start, step, drive
    found = switched_flight(*given, pieces.substeps, discrete=begin)
    assert found.located is not None
    stop = start + drive.angle.shape[0] * step
    last = jax.tree.map(lambda one: one[-1], drive)
    system = model.during(stop - step / 2, last)(stop)
    assert isinstance(system, SwitchedSystem)
    return found.states[-1], found.located.mode, (stop, system)


def last_discrete_state(
    model: Model, state, start, drive: DriveState, flight: Flight
) -> Int[Array, ""]:
    """Return the index of the discrete state at the end of a flight."""
    known, _ = _started(model, state, start, drive)
    assert flight.located is not None
    return discrete_state_of(known, flight.located.mode.negative)


def most_likely(
    costs: Float[Array, "k d"],
    follows: Bool[Array, "k d d"],
    stated: Int[Array, ""],
    joint: Int[Array, " k"],
) -> Int[Array, " k"]:
    """Return the sequence of discrete states with the lowest total cost, by dynamic
    programming (the Viterbi algorithm).

    Args:
        costs: Cost of each piece for each discrete state in which it may begin.
        follows: Whether the next piece may then begin in each of the discrete states.
        stated: The discrete state in which a motion starts according to the system.
        joint: Kind of the predecessor of each piece.

    Returns:
        Index of the discrete state in which each piece begins.
    """
    every = jnp.arange(costs.shape[1])
    most = jnp.finfo(costs.dtype).max / 1e3
    # a motion that diverges is the least likely
    costs = jnp.where(jnp.isfinite(costs), costs, most)
    # the first piece follows the start of the recording in the stated state
    same = (every[:, None] == every[None])[None]
    before = jnp.concatenate([same, follows[:-1]])
    free = (joint == FREE) & (jnp.arange(len(joint)) > 0)

    def further(total, one):
        cost, followed, free = one
        reached = total[:, None] + jnp.where(followed | free, 0.0, JUMP)
        best = jnp.argmin(reached, axis=0)
        total = jnp.min(reached, axis=0) + cost
        # only differences matter
        return total - jnp.min(total), best

    begin = jnp.where(every == stated, 0.0, most)
    total, best = jax.lax.scan(further, begin, (costs, before, free))

    def back(state, one):
        return one[state], state

    return jax.lax.scan(back, jnp.argmin(total), best, reverse=True)[1]


def stated_discrete_state(
    model: Model, state, start, drive: DriveState
) -> Int[Array, ""]:
    """Return the index of the discrete state in which a motion starts according to the
    system; the model has a drive state for each step.
    """
    known, system = _started(model, state, start, drive)
    x = state[: state.shape[0] - len(filtered_channels(model))]
    return discrete_state_of(known, system.sides(start, x) < 0)


def _started(
    model: Model, state, start, drive: DriveState
) -> tuple[Surfaces, SwitchedSystem]:
    first = jax.tree.map(lambda one: one[0], drive)
    system = model.during(start, first)(start)
    assert isinstance(system, SwitchedSystem)
    x = state[: state.shape[0] - len(filtered_channels(model))]
    return surfaces_in(system, start, x), system


def number_of_discrete_states(model: Model, size: int) -> int:
    """Return how many discrete states a motion of a model with `size` state components
    has.
    """
    if not isinstance(model.system, SwitchedSystem):
        return 1
    known = surfaces_in(model.system, jnp.zeros(()), jnp.zeros(size))
    return len(known.remembered)
