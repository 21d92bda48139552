"""Score and information of every piece and joint about a point."""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from ...hybrid.caches import Cache
from ...hybrid.programs import program
from ._discrete_states import discrete_ends
from ._each_record import each_record, kinds, of_record
from ._extras import Extras
from ._fly import fly, fly_without_derivatives
from ._joint import joint, joint_inputs, tied
from ._layout import Layout
from ._likelihood import score_all
from ._linear import (
    flight_inputs,
    flown,
    linear_pieces,
    LinearPieces,
    rested_all,
)
from ._pieces import Pieces
from ._seen_directly import shows_directly


# The last linearisations: a fit often begins where another ended, and the evidence for
# a fit is assessed at its end
_LATEST = Cache(12)
# Largest ratio of two scales between which a linearisation is converted
_RATIO = 1e50


class Point(NamedTuple):
    """Values of the parameters, and states at the beginning of each piece.

    `discrete` is the index of the discrete state there, for a system with several.
    """

    values: Float[Array, "r q"]
    """Values of the parameters of each recording, in their units, shape `(r, q)`."""
    states: Float[Array, "r k n"]
    """State at the beginning of each piece, shape `(r, k, n)`."""
    discrete: Int[Array, "r k"] | None = None
    """Discrete state at the beginning of each piece, shape `(r, k)`, or `None`."""


class Blocks(NamedTuple):
    """Normal equations of the pieces of one recording: information and score.

    `ss`, `sp` and `s` belong to the state of each piece; `pp` and `p` belong to the
    parameters and are summed over all pieces and joints; `before` couples the state of
    a piece to that of the previous piece.
    """

    ss: Float[Array, "k n n"]
    """Information of each piece's state, shape `(k, n, n)`."""
    sp: Float[Array, "k n m"]
    """Information that couples state and parameters, shape `(k, n, m)`."""
    s: Float[Array, "k n"]
    """Score of each piece's state, shape `(k, n)`."""
    before: Float[Array, "k n n"]
    """Coupling of a piece's state to that of the previous piece, shape `(k, n, n)`."""
    pp: Float[Array, "m m"]
    """Information of the parameters, summed over all pieces and joints, shape `(m, m)`.
    """
    p: Float[Array, " m"]
    """Score of the parameters, shape `(m,)`."""


class Costs(NamedTuple):
    """Minus twice the log-likelihood of each piece, and of each joint (the continuity
    condition between two pieces).
    """

    flown: Float[Array, "r k"]
    """Cost of each piece in flight, shape `(r, k)`."""
    joints: Float[Array, "r k"]
    """Cost of each joint, shape `(r, k)`."""
    rested: Float[Array, "r kc"]
    """Cost of each piece in contact, shape `(r, kc)`."""


def assemble(
    layout: Layout,
    pieces: Pieces,
    extras: Extras,
    point: Point,
    columns: Int[Array, "r m"],
    scales: Float[Array, "r m"],
) -> tuple[Blocks, Costs]:
    """Linearise about a point; recordings are distributed over the cores.

    The last results are kept: if only the scales differ, they are converted.

    The example continues the one in [`jaxcam.fitting.fit`][].

    Args:
        layout: The location of the parameters in the model.
        pieces: The pieces of all recordings.
        extras: Further arguments of the compiled programs.
        point: The point.
        columns: Parameters that are free in each recording, shape `(r, m)`.
        scales: Scales of the normal equations, shape `(r, m)`; zero for padding.

    Returns:
        Normal equations and costs.

    Examples:
        >>> from jaxcam.fitting.engine import assemble, free_columns
        >>> columns = free_columns(problem, None)
        >>> given = problem.layout, problem.pieces, problem.extras, found.point
        >>> free = jnp.asarray(columns.local), jnp.asarray(columns.scales)
        >>> blocks, costs = assemble(*given, *free)
        >>> round(float(np.sum(costs.flown)) / len(run), 2)  # per sample
        1.0
    """

    about = extras, point, columns
    given = layout, about, np.asarray(scales) == 0
    values = [np.asarray(leaf) for leaf in jax.tree.leaves(eqx.filter(given, _shaped))]
    # the pieces are kept, so that no other object can have their identity
    key = kinds(given), id(pieces), *(value.tobytes() for value in values)
    found = _LATEST.find(key)
    if found is None or not _convertible(found[1], scales):
        found = pieces, scales, _linearise_all(layout, pieces, *about, scales)
        _LATEST.keep(key, found)
    _, unit, (blocks, costs) = found
    return _rescaled(blocks, unit, scales), costs


def _linearise_all(layout, pieces, extras, point, columns, scales):
    shown = shows_directly(layout, pieces, columns, scales)
    every = with_begins(pieces, point), extras, point.states, columns, scales

    def record(row):
        values, one = of_record((point.values, every), row)
        return assemble_one(layout.about(values), *one, shown)

    args = layout, of_record((point.values, every), 0), shown
    return each_record(record, columns.shape[0], (assemble_one, args))


def _shaped(leaf) -> bool:
    return hasattr(leaf, "shape")


def _convertible(before, after) -> bool:
    """Return whether products with both scales neither overflow nor underflow."""
    before, after = (np.abs(np.asarray(a)[np.asarray(a) != 0]) for a in (before, after))
    ratio = after / before
    return bool(np.all((ratio > 1 / _RATIO) & (ratio < _RATIO)))


def _rescaled(blocks: Blocks, before, after) -> Blocks:
    """Return normal equations with other scales of the parameters, `(r, m)` each."""
    before, after = np.asarray(before), np.asarray(after)
    if np.array_equal(before, after):
        return blocks
    unit = after / np.where(before == 0, 1.0, before)
    return blocks._replace(
        sp=jnp.asarray(np.asarray(blocks.sp) * unit[:, None, None]),
        pp=jnp.asarray(np.asarray(blocks.pp) * unit[:, :, None] * unit[:, None]),
        p=jnp.asarray(np.asarray(blocks.p) * unit),
    )


@program
def assemble_one(near, pieces, extras, states, columns, scales, shown):
    """Apply `assemble` to one recording, given its arrays."""
    near = near.by(columns, scales)

    def model_at(change, start, step):
        del start, step
        return near.at(change)

    width = columns.shape[0]
    found = linear_pieces(model_at, pieces, extras, states, width, shown)
    costs = Costs(found.flown_cost, found.joint_cost, found.rested_cost)
    return chained(found), costs


def with_begins(pieces: Pieces, point: Point) -> Pieces:
    """Return the pieces with the discrete states in which they begin."""
    return dataclasses.replace(pieces, begins=point.discrete)


def predict(layout: Layout, pieces: Pieces, extras: Extras, point: Point):
    """Predict samples in flight and in contact, and the joints, of all recordings."""
    every = with_begins(pieces, point), extras, point.values, point.states

    def record(row):
        return _predict_one(layout, *of_record(every, row))

    args = _predict_one, layout, of_record(every, 0)
    return each_record(record, point.values.shape[0], args)


@program
def _predict_one(layout, pieces, extras, values, states):
    given = values, states, pieces.substeps
    return _predicted_one(layout, pieces, extras, *given, fly_without_derivatives)


def _predicted_one(layout, pieces, extras, values, states, substeps, flying=fly):
    """Predict one recording, given its arrays."""
    model = layout.at(values)
    end, seen = jax.vmap(lambda *a: flown(flying, model, *a, substeps=substeps))(
        states, *flight_inputs(pieces)
    )
    last = None
    if pieces.begins is not None:
        last = discrete_ends(model, pieces, states).last
    resting = rested_all(model, pieces, extras)
    before = jnp.concatenate([states[:1], end[:-1]])
    joints = jax.vmap(lambda *a: joint(model, pieces.reach, *a))(
        before, states, *joint_inputs(pieces, extras.sharpness, last)
    )
    return seen, resting, joints


@program
def cost_of(layout: Layout, pieces: Pieces, extras: Extras, point: Point) -> Costs:
    """Return the costs alone, without scores or information; this function can be
    differentiated in reverse mode.
    """
    # the number of substeps is the same for all recordings, so that their loops can be
    # run as one
    substeps = jnp.max(pieces.substeps)

    def record(pieces, extras, values, states):
        return _predicted_one(layout, pieces, extras, values, states, substeps)

    every = with_begins(pieces, point), extras, point.values, point.states
    seen, resting, off = jax.vmap(record)(*every)
    sensors = tuple(layout.model.sensors.values())

    def total(part, predicted):
        found = score_all(sensors, part.value, predicted)
        return jnp.sum(jnp.where(part.known, found.cost, 0.0), axis=(-3, -2, -1))

    missed = tied(off, extras.sharpness, pieces.joint)
    return Costs(
        total(pieces.flown, seen),
        jnp.sum(missed**2, axis=-1),
        total(pieces.rested, resting),
    )


def chained(found: LinearPieces) -> Blocks:
    """Return the normal equations of one recording: its pieces and joints summed.

    Args:
        found: The linear pieces.

    Returns:
        The [`jaxcam.fitting.engine.Blocks`][].
    """
    size = found.later.shape[-1]
    information, later = found.information, found.later
    earlier, params = (
        found.earlier[..., :size],
        found.direct + found.earlier[..., size:],
    )

    def into_previous(array):
        return jnp.concatenate([array[1:], jnp.zeros_like(array[:1])])

    def product(a, b):
        return jnp.einsum("kea,keb->kab", a, b)

    def times(a):
        return -jnp.einsum("kea,ke->ka", a, found.tied)

    ss = information[:, :size, :size] + product(later, later)
    ss = ss + into_previous(product(earlier, earlier))
    sp = information[:, :size, size:] + product(later, params)
    sp = sp + into_previous(product(earlier, params))
    s = found.slope[:, :size] + times(later) + into_previous(times(earlier))
    inner = information[:, size:, size:] + product(params, params)
    pp = found.pp + jnp.sum(inner, axis=0)
    p = found.p + jnp.sum(found.slope[:, size:] + times(params), axis=0)
    return Blocks(ss, sp, s, product(later, earlier), pp, p)


def cost_by_recording(costs: Costs, weights) -> Float[np.ndarray, " r"]:
    """Return the weighted cost of each recording.

    A joint has the smaller of the weights of its two pieces. A contact whose surface is
    not found has no cost, because it gives no information; data with zero weight have
    no cost either.

    Args:
        costs: The costs.
        weights: The [`jaxcam.fitting.engine.Weights`][] of the data.

    Returns:
        The costs, shape `(r,)`.
    """
    total = np.zeros(len(weights.flown))
    found = costs._replace(rested=np.nan_to_num(costs.rested))
    for weight, cost in _weighted(weights.flown, weights.rested, found):
        total += np.sum(weight * np.where(weight > 0, cost, 0.0), axis=1)
    return total


def total_cost(costs: Costs, extras) -> float:
    """Return the weighted cost of all pieces; a joint has the smaller of the weights of
    its two pieces.

    The example continues the one in [`jaxcam.fitting.engine.assemble`][].

    Args:
        costs: The costs.
        extras: Further arguments of the compiled programs, with the weights.

    Returns:
        The cost.

    Examples:
        >>> from jaxcam.fitting.engine import total_cost
        >>> bool(np.isclose(total_cost(costs, problem.extras), found.cost))
        True
    """
    total = 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        for weight, cost in _weighted(extras.weight, extras.rest_weight, costs):
            # data with zero weight have no cost, even if they are not finite
            total += np.sum(np.where(weight > 0, weight * cost, 0.0))
    return float(total)


def _weighted(flown, rested, costs: Costs) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return weights and costs of flights, joints and contacts."""
    flown, rested = np.asarray(flown), np.asarray(rested)
    before = np.concatenate([flown[:, :1], flown[:, :-1]], axis=1)
    shares = flown, np.minimum(flown, before), rested
    return list(zip(shares, map(np.asarray, costs), strict=True))
