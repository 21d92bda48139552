"""Linearise each piece and joint of one recording about a point.

A joint is the condition that connects a piece with the one before it.
"""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ._discrete_states import last_discrete_state
from ._extras import Extras
from ._fly import flight_with_substeps, fly_about
from ._groups import in_groups
from ._joint import joint, joint_inputs, previous, strength, tied
from ._likelihood import score_all
from ._model import Model
from ._pieces import FREE, Pieces
from ._predict import (
    calibration,
    rest,
    samples,
)
from ._through_nodes import normal_through, shares_of


class LinearPieces(NamedTuple):
    """Pieces and joints of one recording, before summation.

    The first `n` of `a = n + m` columns are the state at the beginning of the piece,
    and the others are the parameters.
    """

    information: Float[Array, "k a a"]
    """Information of the samples of each piece in flight, shape `(k, a, a)`."""
    slope: Float[Array, "k a"]
    """Gradient of the cost of the samples of each piece in flight, shape `(k, a)`."""
    pp: Float[Array, "m m"]
    """Information of all samples in contact on the parameters, shape `(m, m)`."""
    p: Float[Array, " m"]
    """Gradient of the cost of all samples in contact, shape `(m,)`."""
    later: Float[Array, "k e n"]
    """Derivatives of each joint's mismatch with respect to the state after the joint,
    in units of the error of the joint.
    """
    earlier: Float[Array, "k e a"]
    """Derivatives of each joint's mismatch with respect to the columns of the previous
    piece, in units of the error of the joint.
    """
    direct: Float[Array, "k e m"]
    """Derivatives of each joint's mismatch with respect to the parameters at fixed
    states, in units of the error of the joint.
    """
    tied: Float[Array, "k e"]
    """Mismatch at each joint, in units of its error."""
    flown_cost: Float[Array, " k"]
    """Cost of each piece in flight."""
    joint_cost: Float[Array, " k"]
    """Cost of each joint."""
    rested_cost: Float[Array, " kc"]
    """Cost of each piece in contact."""


def linear_pieces(
    model_at: Callable[..., Model],
    pieces: Pieces,
    extras: Extras,
    states,
    width: int,
    shown: bool,
) -> LinearPieces:
    """Linearise one recording about its states.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        model_at: `model_at(change, start, step)` is the model of a piece that begins at
            `start` with steps of length `step`, where `change` `(m,)` is the change of
            the parameters from the point.
        pieces: The pieces.
        extras: Further arguments of the compiled programs.
        states: States at the beginning of each piece.
        width: Number m of parameters.
        shown: Whether a parameter may affect samples other than through the motion and
            the calibration of the sensors.

    Returns:
        A [`jaxcam.fitting.engine.LinearPieces`][].

    Examples:
        >>> from jaxcam.fitting.engine import linear_pieces
        >>> first = lambda tree: jax.tree.map(lambda leaf: leaf[0], tree)
        >>> values, states, _ = first(found.point)
        >>> model_at = lambda change, start, step: problem.layout.at(values + change)
        >>> record = first(problem.pieces), first(problem.extras), states
        >>> made = jax.jit(lambda: linear_pieces(model_at, *record, 1, False))()
        >>> cost = jnp.sum(made.flown_cost) + jnp.sum(made.joint_cost)
        >>> round(float(cost / found.cost), 3)
        1.0
    """
    size, origin = states.shape[-1], jnp.zeros(width)
    found = _linear_flights(model_at, pieces, extras, states, origin, shown)
    (end, last), end_rows, flown_cost, information, slope = found
    pp, p, rested_cost = _linear_contacts(model_at, pieces, extras, origin)

    # derivatives with respect to the earlier state, the later state and the parameters
    def joint_of(before, state, t, *inputs):
        def off(before, state, change):
            model = model_at(change, t, jnp.ones_like(t))
            return joint(model, pieces.reach, before, state, t, *inputs)

        return _columns(off, before, state, origin)

    before = jnp.concatenate([states[:1], end[:-1]])
    turned = jnp.concatenate([jnp.zeros_like(end_rows[:1]), end_rows[:-1]])
    inputs = joint_inputs(pieces, extras.sharpness, last)
    joined = jnp.asarray(pieces.joint) != FREE
    none = jnp.zeros(size + 1), jnp.zeros((size + 1, 2 * size + width))
    off, joint_rows = in_groups(joint_of, joined, none, before, states, *inputs)
    joint_rows = joint_rows * strength(extras.sharpness, pieces.joint)[..., None]
    shared = jnp.sqrt(jnp.minimum(extras.weight, previous(extras.weight)))[:, None]
    earlier, later, direct = (
        rows * shared[..., None]
        for rows in (
            jnp.einsum("kei,kia->kea", joint_rows[..., :size], turned),
            joint_rows[..., size : 2 * size],
            joint_rows[..., 2 * size :],
        )
    )
    missed = tied(off, extras.sharpness, pieces.joint)
    joint_cost = jnp.sum(missed**2, axis=-1)
    return LinearPieces(
        information,
        slope,
        pp,
        p,
        later,
        earlier,
        direct,
        missed * shared,
        flown_cost,
        joint_cost,
        rested_cost,
    )


def _linear_flights(model_at, pieces: Pieces, extras: Extras, states, origin, shown):
    """Linearise the pieces in flight.

    **Returns:** for each piece, the state and the discrete state at its end, the
    derivatives of the state, the cost, and information and score of the samples.
    """
    part = pieces.flown
    sensors = tuple(model_at(origin, 0.0, 1.0).sensors.values())

    def piece(state, start, step, drive, place, begin, value, weight, known):
        # outside the derivatives: those of a loop that locates events compile slowly
        model = model_at(origin, start, step)
        fine = flight_with_substeps(
            model, state, start, step, drive, pieces.substeps, begin
        )

        def flight(state, change):
            model = model_at(change, start, step)
            end, nodes = fly_about(fine, model, state, start, step, drive)
            return end, (nodes, calibration(model))

        def sampled(model, given):
            along = _along(start, step, drive)
            nodes, sensing = given
            return samples(model, nodes, sensing, start, step, place, along)

        def predicted(state, change):
            end, given = flight(state, change)
            return end, sampled(model_at(change, start, step), given)

        if shown:
            (end, seen), (end_rows, rows) = _columns(predicted, state, origin)
        else:
            (end, given), (end_rows, rows) = _columns(flight, state, origin)
            seen = sampled(model, given)
        found = score_all(sensors, value, seen)
        told = weight * found.information, weight * found.score
        if shown:
            normal = _normal(rows, *told)
        else:
            shares = shares_of(lambda given: sampled(model, given), given)
            by_nodes, by_sensing = rows
            normal = normal_through(by_nodes, by_sensing, shares, *told)
        last = begin
        if begin is not None:
            last = last_discrete_state(model, state, start, drive, fine)
        cost = jnp.sum(jnp.where(known, found.cost, 0.0))
        return (end, last), end_rows, cost, *normal

    weight = jnp.where(part.known, extras.weight[:, None, None, None], 0.0)
    # the results for a group of padding
    size, last = states.shape[-1], None if pieces.begins is None else pieces.begins[0]
    width = size + len(origin)
    square, row = jnp.zeros((width, width)), jnp.zeros(width)
    empty = (states[0], last), square[:size], jnp.zeros(()), square, row
    given = states, *flight_inputs(pieces), part.value, weight, part.known
    return in_groups(piece, jnp.asarray(pieces.exists), empty, *given)


def _linear_contacts(model_at: Callable[..., Model], pieces: Pieces, extras, origin):
    """Return the information and score of the parameters from the pieces in contact,
    and the cost of each piece.
    """
    width = len(origin)
    if not len(pieces.rest_exists):
        return jnp.zeros((width, width)), jnp.zeros(width), jnp.zeros(0)

    def contact(guess, start, step, *inputs):
        def predicted(change):
            model = model_at(change, start, step)
            return rested(model, guess, start, step, *inputs)

        return _columns(predicted, origin)

    seen, rows = jax.vmap(contact)(*rest_inputs(pieces, extras))
    part = pieces.rested
    sensors = tuple(model_at(origin, 0.0, 1.0).sensors.values())
    found = score_all(sensors, part.value, seen)
    weight = jnp.where(part.known, extras.rest_weight[:, None, None, None], 0.0)
    # if the surface cannot be found, the piece gives no information
    rows = jnp.where(part.known[..., None], rows, 0.0)
    score = weight * jnp.where(part.known, found.score, 0.0)
    information, slope = jax.vmap(_normal)(rows, weight * found.information, score)
    pp, p = jnp.sum(information, axis=0), jnp.sum(slope, axis=0)
    cost = jnp.sum(jnp.where(part.known, found.cost, 0.0), axis=(1, 2, 3))
    return pp, p, cost


def _normal(rows, information, score):
    """Return the information and score of a piece, summed over its samples."""
    # one matrix product per piece: a product of three arrays takes twice as long
    rows = rows.reshape(-1, rows.shape[-1])
    information, score = (a.reshape(-1, 1) for a in (information, score))
    return rows.T @ (information * rows), (rows.T @ score)[:, 0]


def _columns(function, *args):
    """Return the value and Jacobian of a function of several vectors, with the columns
    side by side.

    The vectors are separate arguments, so that parts that depend on only one of them
    are computed once for all pieces that share it.
    """
    count = sum(len(one) for one in args)
    edges = np.cumsum([len(one) for one in args])[:-1]
    unit = jnp.split(jnp.eye(count), edges, axis=1)

    def pushed(*tangents):
        return jax.jvp(function, args, tangents)

    return jax.vmap(pushed, out_axes=(None, -1))(*unit)


def flown(
    flying, model: Model, state, start, step, drive, place, discrete, *, substeps
):
    """Return the end of a piece and its samples; `flying` is `fly`, or
    `fly_without_derivatives`.
    """
    end, nodes = flying(model, state, start, step, drive, substeps, discrete)
    along = _along(start, step, drive)
    return end, samples(model, nodes, calibration(model), start, step, place, along)


def _along(start, step, drive):
    """Return the middle of each step, and the drive there."""
    numbers = jnp.arange(drive.angle.shape[0], dtype=float)
    return start + (numbers + 0.5) * step, drive


def rested(model: Model, guess, start, step, drive, place):
    nodes = rest(model, guess, start, step, drive)
    along = start + jnp.arange(drive.angle.shape[0], dtype=float) * step, drive
    along = jax.tree.map(lambda one: one[:-1], along)
    return samples(model, nodes, calibration(model), start, step, place, along)


def rested_all(model: Model, pieces: Pieces, extras: Extras):
    """Return the samples of all pieces in contact of one recording, shape `(kc,
    n, m, c)`.
    """
    if not len(pieces.rest_exists):
        return jnp.zeros(pieces.rested.value.shape)
    return jax.vmap(lambda *a: rested(model, *a))(*rest_inputs(pieces, extras))


def flight_inputs(pieces: Pieces):
    part = pieces.flown
    return part.start, part.step, pieces.drive, part.place, pieces.begins


def rest_inputs(pieces: Pieces, extras: Extras):
    part = pieces.rested
    return (
        extras.guess,
        part.start,
        part.step,
        pieces.rest_drive,
        part.place,
    )
