"""Scores and information of every piece and joint about a point."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from ._likelihood import score_all
from ._model import Model
from ._pieces import FLIGHT, IMPACT, Pieces
from ._predict import flight_joint, fly, impact_joint, rest, samples


class Point(NamedTuple):
    """What varies: values `(r, q)` of the parameters of each record, in their units,
    and the state `(r, k, n)` at the beginning of each piece."""

    values: Float[Array, "r q"]
    states: Float[Array, "r k n"]


class Layout(eqx.Module):
    """Where the parameters are in a model: its leaves, and which of them are fitted."""

    model: Model
    places: tuple[int, ...] = eqx.field(static=True)

    def at(self, values: Float[Array, " q"]) -> Model:
        """The model with the parameters at some values."""
        leaves, tree = jax.tree.flatten(self.model)
        for column, place in enumerate(self.places):
            leaves[place] = values[column]
        return jax.tree.unflatten(tree, leaves)


class Blocks(NamedTuple):
    """Normal equations of the pieces of one record: information and score.

    `ss, sp, s` of each piece's state; `pp, p` of the parameters, over all pieces and
    joints; `before` couples the state of a piece to that of the one before it.
    """

    ss: Float[Array, "k n n"]
    sp: Float[Array, "k n m"]
    s: Float[Array, "k n"]
    before: Float[Array, "k n n"]
    pp: Float[Array, "m m"]
    p: Float[Array, " m"]


class Costs(NamedTuple):
    """Minus twice the log-likelihood of each piece, by what it is made of."""

    flown: Float[Array, "r k"]
    joints: Float[Array, "r k"]
    rested: Float[Array, "r kc"]


class Sharpness(NamedTuple):
    """Standard errors of the joints of one record."""

    flight: Float[Array, "k n"]
    impact: Float[Array, "k n"]
    gap: Float[Array, " k"]


class Extras(NamedTuple):
    """What else a program needs: reference states of contact and the joints' errors.

    `weight` `(r, k)` and `rest_weight` `(r, kc)` of the data of each piece.
    """

    guess: Float[Array, "r kc n"]
    sharpness: Sharpness
    weight: Float[Array, "r k"]
    rest_weight: Float[Array, "r kc"]


@eqx.filter_jit
def assemble(
    layout: Layout,
    pieces: Pieces,
    extras: Extras,
    point: Point,
    columns: Int[Array, "r m"],
    scales: Float[Array, "r m"],
) -> tuple[Blocks, Costs]:
    """Linearise about a point.

    **Arguments:** `columns` of the parameters that are free in each record and the
    `scales` that the normal equations are in; a scale of zero fills up the width.
    """

    def record(pieces, extras, values, states, columns, scales):
        return _record(layout, pieces, extras, values, states, columns, scales)

    return jax.vmap(record)(pieces, extras, *point, columns, scales)


@eqx.filter_jit
def predict(layout: Layout, pieces: Pieces, extras: Extras, point: Point):
    """Predicted samples in flight and in contact, and the joints, of all records."""

    def record(pieces, extras, values, states):
        model = layout.at(values)
        end, flown = jax.vmap(lambda *a: _flown(model, *a))(
            states, *_flight_inputs(pieces)
        )
        rested = jax.vmap(lambda *a: _rested(model, *a))(*_rest_inputs(pieces, extras))
        before = jnp.concatenate([states[:1], end[:-1]])
        joints = jax.vmap(lambda *a: _joint(model, pieces.reach, *a))(
            before, states, *_joint_inputs(pieces)
        )
        return flown, rested, joints

    return jax.vmap(record)(pieces, extras, *point)


@eqx.filter_jit
def cost_of(layout: Layout, pieces: Pieces, extras: Extras, point: Point) -> Costs:
    """Costs without derivatives; can be differentiated in reverse mode."""
    flown, rested, joints = predict(layout, pieces, extras, point)
    sensors = tuple(layout.model.sensors.values())

    def total(part, predicted):
        found = score_all(sensors, part.value, predicted)
        return jnp.sum(jnp.where(part.known, found.cost, 0.0), axis=(-3, -2, -1))

    off, error = joints, extras.sharpness
    tied = _tied(off, error, pieces.joint)
    return Costs(
        total(pieces.flown, flown),
        jnp.sum(tied**2, axis=-1),
        total(pieces.rested, rested),
    )


def _record(layout, pieces: Pieces, extras, values, states, columns, scales):
    size, width = states.shape[-1], columns.shape[0]

    def model_at(change):
        return layout.at(values.at[columns].add(change * scales))

    origin = jnp.zeros(width)
    sensors = tuple(layout.model.sensors.values())

    def piece(state, *inputs):
        def predicted(both):
            end, seen = _flown(model_at(both[size:]), both[:size], *inputs)
            return (end, seen), (end, seen)

        both = jnp.concatenate([state, origin])
        (end_rows, rows), (end, seen) = jax.jacfwd(predicted, has_aux=True)(both)
        return end_rows, rows, end, seen

    end_rows, rows, end, seen = jax.vmap(piece)(states, *_flight_inputs(pieces))
    part = pieces.flown
    found = score_all(sensors, part.value, seen)
    weight = jnp.where(part.known, extras.weight[:, None, None, None], 0.0)
    information = jnp.einsum(
        "knmca,knmc,knmcb->kab", rows, weight * found.information, rows
    )
    slope = jnp.einsum("knmca,knmc->ka", rows, weight * found.score)
    flown_cost = jnp.sum(jnp.where(part.known, found.cost, 0.0), axis=(1, 2, 3))

    # contact depends on the parameters alone
    def contact(*inputs):
        def predicted(change):
            seen = _rested(model_at(change), *inputs)
            return seen, seen

        return jax.jacfwd(predicted, has_aux=True)(origin)

    rest_rows, rest_seen = jax.vmap(contact)(*_rest_inputs(pieces, extras))
    part = pieces.rested
    found = score_all(sensors, part.value, rest_seen)
    weight = jnp.where(part.known, extras.rest_weight[:, None, None, None], 0.0)
    # where the surface cannot be found, nothing can be learnt from it
    rest_rows = jnp.where(part.known[..., None], rest_rows, 0.0)
    pp = jnp.einsum(
        "knmca,knmc,knmcb->ab", rest_rows, weight * found.information, rest_rows
    )
    p = jnp.einsum(
        "knmca,knmc->a", rest_rows, weight * jnp.where(part.known, found.score, 0.0)
    )
    rested_cost = jnp.sum(jnp.where(part.known, found.cost, 0.0), axis=(1, 2, 3))

    # joints: rows for the earlier state, the later state and the parameters
    def joint(before, state, *inputs):
        def off(all_):
            model = model_at(all_[2 * size :])
            found = _joint(
                model, pieces.reach, all_[:size], all_[size : 2 * size], *inputs
            )
            return found, found

        return jax.jacfwd(off, has_aux=True)(jnp.concatenate([before, state, origin]))

    before = jnp.concatenate([states[:1], end[:-1]])
    turned = jnp.concatenate([jnp.zeros_like(end_rows[:1]), end_rows[:-1]])
    joint_rows, off = jax.vmap(joint)(before, states, *_joint_inputs(pieces))
    tied = _tied(off, extras.sharpness, pieces.joint)
    strength = _strength(extras.sharpness, pieces.joint)
    joint_rows = joint_rows * strength[..., None]
    earlier = jnp.einsum("kei,kia->kea", joint_rows[..., :size], turned)
    later, direct = joint_rows[..., size : 2 * size], joint_rows[..., 2 * size :]
    earlier_s, params = earlier[..., :size], direct + earlier[..., size:]
    shared = jnp.sqrt(jnp.minimum(extras.weight, _previous(extras.weight)))[:, None]
    tied_now = tied * shared
    later, earlier_s, params = (
        x * shared[..., None] for x in (later, earlier_s, params)
    )

    def into_previous(array):
        return jnp.concatenate([array[1:], jnp.zeros_like(array[:1])])

    def product(a, b):
        return jnp.einsum("kea,keb->kab", a, b)

    def times(a):
        return -jnp.einsum("kea,ke->ka", a, tied_now)

    ss = information[:, :size, :size] + product(later, later)
    ss = ss + into_previous(product(earlier_s, earlier_s))
    sp = information[:, :size, size:] + product(later, params)
    sp = sp + into_previous(product(earlier_s, params))
    s = slope[:, :size] + times(later) + into_previous(times(earlier_s))
    pp = pp + jnp.sum(information[:, size:, size:] + product(params, params), axis=0)
    p = p + jnp.sum(slope[:, size:] + times(params), axis=0)
    blocks = Blocks(ss, sp, s, product(later, earlier_s), pp, p)
    return blocks, Costs(flown_cost, jnp.sum(tied**2, axis=-1), rested_cost)


def _flown(model: Model, state, start, step, angle, rate, place):
    end, nodes = fly(model, state, start, step, angle, rate)
    return end, samples(model, nodes, step, place)


def _rested(model: Model, guess, start, step, angle, rate, place):
    return samples(model, rest(model, guess, start, step, angle, rate), step, place)


def _flight_inputs(pieces: Pieces):
    part = pieces.flown
    return part.start, part.step, pieces.angle, pieces.rate, part.place


def _rest_inputs(pieces: Pieces, extras: Extras):
    part = pieces.rested
    return (
        extras.guess,
        part.start,
        part.step,
        pieces.rest_angle,
        pieces.rest_rate,
        part.place,
    )


def _joint_inputs(pieces: Pieces):
    return pieces.flown.start, pieces.angle_at, pieces.rate_at, pieces.joint


def _joint(model: Model, reach, before, state, t, angle, rate, kind):
    """State and gap in one vector `(n + 1,)`, whichever kind of joint it is."""
    inner = jnp.concatenate([*_flat(flight_joint(before, state))])
    # where there is no impact the search for one must not spoil the derivatives
    hit = kind == IMPACT
    found = impact_joint(model, before, state, t, angle, rate, reach)
    outer = jnp.concatenate([*_flat(found)])
    return jnp.where(hit, outer, jnp.where(kind == FLIGHT, inner, 0.0))


def _flat(joint):
    return joint.state, joint.gap[None]


def _strength(sharpness: Sharpness, kind):
    """One over the error of each part of a joint, zero where there is none."""
    error = jnp.concatenate([sharpness.impact, sharpness.gap[..., None]], axis=-1)
    flight = jnp.concatenate(
        [sharpness.flight, jnp.full_like(sharpness.gap[..., None], jnp.inf)], axis=-1
    )
    kind = kind[..., None]
    strength = jnp.where(
        kind == IMPACT, 1 / error, jnp.where(kind == FLIGHT, 1 / flight, 0.0)
    )
    return strength


def _tied(off, sharpness, kind) -> Any:
    return off * _strength(sharpness, kind)


def _previous(array):
    return jnp.concatenate([array[:1], array[:-1]])
