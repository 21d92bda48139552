"""The discrete states in which the pieces of all recordings begin and end."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from ...hybrid.programs import program
from ._discrete_states import (
    discrete_ends,
    Ends,
    most_likely,
    stated_discrete_state,
    with_late_switches,
)
from ._layout import Layout
from ._linearise import Point, with_begins
from ._pieces import FREE, Pieces, REACH


def unexplained_jumps(
    layout: Layout, pieces: Pieces, point: Point, weight
) -> Bool[np.ndarray, "r k"]:
    """Return which pieces begin in a discrete state to which no event near the end of
    the previous piece leads: the samples show a switch that the model does not have.

    Args:
        layout: The location of the parameters in the model.
        pieces: The pieces of all recordings.
        point: Parameters, and states at the beginning of each piece.
        weight: Weight of each piece, shape `(r, k)`; a piece without weight does not
            show in which discrete state it begins or ends.

    Returns:
        Shape `(r, k)`; false everywhere if the system has only one discrete state.
    """
    exists = np.asarray(pieces.exists)
    if point.discrete is None:
        return np.zeros(exists.shape, dtype=bool)
    follows = np.asarray(all_discrete_ends(layout, pieces, point).follows)
    first = np.asarray(point.discrete)
    explained = np.take_along_axis(follows[:, :-1], first[:, 1:, None], axis=2)
    jumps = np.zeros(exists.shape, dtype=bool)
    counts = np.asarray(weight) > 0
    jumps[:, 1:] = ~explained[..., 0] & counts[:, :-1] & counts[:, 1:]
    return jumps & exists & (np.asarray(pieces.joint) != FREE)


def begun_before_switches(layout: Layout, pieces: Pieces, point: Point) -> Point | None:
    """Return a point at which pieces that begin before a switch also begin in the
    discrete state before it; `None` if they all do.

    A descent keeps the discrete states. A piece that begins after a switch is therefore
    continued backwards from it, although the switch may have moved into the piece by
    several samples.
    """
    states, discrete = _begun_before(layout, pieces, point)
    if np.array_equal(np.asarray(discrete), np.asarray(point.discrete)):
        return None
    return Point(point.values, states, discrete)


@program
def _begun_before(layout: Layout, pieces: Pieces, point: Point):
    def record(values, states, pieces):
        least = pieces.reach / REACH
        return with_late_switches(layout.at(values), pieces, states, least)

    pieces = jax.tree.map(jnp.asarray, with_begins(pieces, point))
    return jax.vmap(record)(point.values, point.states, pieces)


@program
def all_discrete_ends(layout: Layout, pieces: Pieces, point: Point) -> Ends:
    """Return the discrete states at the ends of the pieces of all recordings."""

    def record(values, states, pieces):
        return discrete_ends(layout.at(values), pieces, states)

    pieces = jax.tree.map(jnp.asarray, with_begins(pieces, point))
    return jax.vmap(record)(point.values, point.states, pieces)


@program
def most_likely_starts(
    layout: Layout,
    pieces: Pieces,
    point: Point,
    costs: Float[Array, "r k d"],
    follows: Bool[Array, "r k d d"],
) -> Int[Array, "r k"]:
    """Return the most likely discrete states in which the pieces begin.

    **Arguments:** as for `most_likely`, for all recordings.
    """

    def record(values, states, start, drive, joint, costs, follows):
        begin = jax.tree.map(lambda one: one[0], (states, start, drive))
        stated = stated_discrete_state(layout.at(values), *begin)
        return most_likely(costs, follows, stated, joint)

    part = pieces.flown.start, pieces.drive, pieces.joint, costs, follows
    arrays = jax.tree.map(jnp.asarray, part)
    return jax.vmap(record)(point.values, point.states, *arrays)
