"""Compute the derivative over a period as a product over its flights and events."""

from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from .._event_law import (
    completed_law,
    contact_projector,
    event_crossing,
    field_of,
    gap_of,
    impact_of,
    onto_contact,
)
from .._flight import fly_linearised
from ._pieces import IMPACT, LAST_IMPACT, TurnPieces


class Product(NamedTuple):
    """The derivative over a period, and estimates of its accuracy."""

    state: Float[Array, " n"]
    """State at the end, (n,)."""
    matrix: Float[Array, "n columns"]
    """Derivatives (n, n + q) with respect to the initial state, then the q
    parameters.
    """
    determinant: Float[Array, ""]
    """Determinant of the first n columns, as a product over flights and impacts."""
    condition: Float[Array, ""]
    """Condition number: relative error of the first n columns, per relative error of
    each factor.
    """


def product_of(
    build: Callable,
    parameters: Float[Array, " q"],
    state: Float[Array, " n"],
    pieces: TurnPieces,
    sticks: bool,
) -> Product:
    """Return the product of the transition matrices of the flights and the saltation
    matrices between them.

    **Arguments:** `build(parameters)`, which returns the system; the `parameters`; the
    `state` at the start of the first piece; the `pieces`; and `sticks`, whether any
    piece is in contact (static).
    """
    n, q = state.shape[0], parameters.shape[0]
    pieces = with_all_constraints(build(parameters), pieces, state)

    def field(contact):
        mode = contact if sticks else None
        return lambda p, t, x: field_of(build(p), mode)(t, x)

    def one(x, piece: TurnPieces):
        flight = fly_linearised(
            field(piece.contact), parameters, piece.start, x, piece.end
        )
        matrix = flight.matrix
        if sticks:
            held = _held(build, parameters, piece.end, flight.state, piece.contact)
            matrix = _compose(held, matrix, n)
        entry, after, change = _event(build, parameters, piece, flight.state, sticks)
        return after, (_compose(entry, matrix, n), flight.log_volume, change)

    end, (factors, volumes, changes) = jax.lax.scan(one, state, pieces)
    start = jnp.eye(n, n + q)
    if sticks:
        start = _held(build, parameters, pieces.start[0], state, pieces.contact[0])

    def extend(matrix, factor):
        longer = _compose(factor, matrix, n)
        return longer, matrix[:, :n]

    matrix, earlier = jax.lax.scan(extend, start, factors)
    determinant = jnp.exp(jnp.sum(volumes)) * jnp.prod(changes)
    return Product(
        end, matrix, determinant, _condition(factors[:, :, :n], earlier, matrix[:, :n])
    )


def with_all_constraints(system, pieces: TurnPieces, state) -> TurnPieces:
    """Return the pieces with a contact flag for every constraint of the system."""
    gap = jax.eval_shape(system.gap, pieces.start[0], state)
    missing = (gap.shape[0] if gap.shape else 1) - pieces.contact.shape[1]

    def wider(flags):
        return jnp.pad(jnp.asarray(flags), ((0, 0), (0, missing)))

    return eqx.tree_at(
        lambda p: (p.contact, p.contact_after),
        jax.tree.map(jnp.asarray, pieces),
        (wider(pieces.contact), wider(pieces.contact_after)),
    )


def _compose(outer, inner, n):
    """Apply the chain rule to two derivatives with the columns [state | parameters]."""
    return (outer[:, :n] @ inner).at[:, n:].add(outer[:, n:])


def _held(build, parameters, t, x, contact):
    """Return the derivative of the projection onto contact with respect to state and
    parameters.
    """
    by_state = contact_projector(build(parameters), t, x, contact)
    by_parameter = jax.jacfwd(lambda p: onto_contact(build(p), t, x, contact))(
        parameters
    )
    return jnp.concatenate([by_state, by_parameter], axis=1)


def _event(build, parameters, piece: TurnPieces, x, sticks):
    """Return the derivative across the event of a piece, the state after it, and the
    determinant of the derivative.
    """
    n = x.shape[0]
    plain = _across(build, parameters, piece, impact_of, sticks)
    nothing = (jnp.eye(n, n + parameters.shape[0]), x, jnp.ones(()))
    found = _select(piece.kind == IMPACT, plain, nothing)
    if not sticks:
        return found
    matrix, rest, _ = _across(build, parameters, piece, completed_law, sticks)
    held = _held(build, parameters, piece.end, rest, piece.contact_after)
    last = (_compose(held, matrix, n), rest, jnp.zeros(()))
    matrix, after, change = _select(piece.kind == LAST_IMPACT, last, found)
    stuck = jnp.any(piece.contact | piece.contact_after)
    return matrix, after, jnp.where(stuck, 0.0, change)


def _across(build, parameters, piece: TurnPieces, law_of, sticks):
    t, x, side = piece.end, piece.before, piece.constraint

    def law(p):
        return law_of(build(p), side)

    def height(p):
        return gap_of(build(p), side)(t, x)

    system = build(parameters)
    before = after = system.vector_field
    if sticks:
        before = field_of(system, jnp.asarray(piece.contact))
        after = field_of(system, jnp.asarray(piece.contact_after))
    law_x, moved, normal, speed = event_crossing(
        law(parameters), gap_of(system, side), before, after, t, x
    )
    hit = piece.kind != 0
    share = moved / jnp.where(hit, speed, 1.0)
    by_state = law_x + jnp.outer(share, normal)
    law_p = jax.jacfwd(lambda p: law(p)(t, x))(parameters)
    by_parameter = law_p + jnp.outer(share, jax.jacfwd(height)(parameters))
    landed = law(parameters)(t, x)
    # the law preserves the gap, so the determinant of the saltation matrix is that of
    # the law times the ratio of the normal velocities after and before the impact
    rate, slope = jax.grad(gap_of(system, side), argnums=(0, 1))(t, landed)
    speed_after = rate + slope @ after(t, landed)
    change = jnp.linalg.det(law_x) * speed_after / jnp.where(hit, speed, 1.0)
    return jnp.concatenate([by_state, by_parameter], axis=1), landed, change


def _select(condition, yes, no):
    return jax.tree.map(lambda a, b: jnp.where(condition, a, b), yes, no)


def _condition(factors, earlier, matrix):
    """Return the sum over the factors of |later| |factor| |earlier| / |product|."""

    def back(later, factor):
        return later @ factor, later

    n = matrix.shape[0]
    _, later = jax.lax.scan(back, jnp.eye(n), factors, reverse=True)

    def norm(a):
        return jnp.sqrt(jnp.sum(a * a, axis=(1, 2)))

    size = jnp.sqrt(jnp.sum(matrix * matrix))
    total = jnp.sum(norm(later) * norm(factors) * norm(earlier))
    return jnp.where(size > 0, total / jnp.where(size > 0, size, 1.0), 1.0)
