"""Compute the derivatives of all steps of a recorded run at once."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import HybridSystem
from jaxcam.hybrid.breakpoints import between
from jaxcam.hybrid.codes import RowKind
from jaxcam.hybrid.loop import Functions
from jaxcam.hybrid.runge_kutta import step, Tableau

from ._event_law import (
    completed_law,
    contact_projector,
    event_crossing,
    field_of,
    gap_of,
    impact_of,
)


class LogRow(NamedTuple):
    """The log entry of one attempted step."""

    kind: Array
    constraint: Array
    t: Array
    before: tuple
    after: tuple
    contact: tuple


class StepStart(NamedTuple):
    """The start of a step."""

    t: Array
    x: tuple
    contact: tuple


def step_matrix(
    system: HybridSystem,
    functions: Functions,
    tableau: Tableau,
    point: StepStart,
    row: LogRow,
) -> Float[Array, "n n"]:
    """Return the derivative of one step and its final event; the identity if there is
    no step.

    The step length is that of the run, so no step control is needed for the derivative.
    """
    n = functions.n
    taken = row.kind != float(RowKind.NOTHING)
    h = jnp.where(taken, row.t - point.t, 0.0)

    def inside(t):
        # steps end at breakpoints, and use the field on one side of them
        return t if system.breakpoints is None else between(t, point.t, row.t, h)

    def end(*x):
        return step(
            tableau,
            lambda t, y: functions.field(inside(t), y, point.contact),
            point.t,
            x,
            h,
        )[0]

    columns = []
    for k in range(n):
        unit = tuple(jnp.where(i == k, 1.0, 0.0) for i in range(n))
        columns.append(jnp.stack(jax.jvp(end, point.x, unit)[1]))
    matrix = jnp.stack(columns, axis=1)
    before, now = jnp.stack(row.before), jnp.stack(row.contact)
    held = jnp.stack(point.contact)
    if functions.planar:
        # contact removes the perturbation
        matrix = jnp.where(held[0], 0.0, matrix)
    else:
        matrix = contact_projector(system, row.t, before, held) @ matrix
    hit = taken & (row.kind == float(RowKind.IMPACT))
    last = taken & (row.kind == float(RowKind.LAST_IMPACT))
    event = _across(system, row, before, held, now, impact_of, functions.planar)
    out = jnp.where(hit, elementwise_product(event, matrix), matrix)
    if functions.planar:
        entry = jnp.zeros((n, n))
    else:
        entry = _across(system, row, before, held, now, completed_law, False)
        rest = completed_law(system, row.constraint)(row.t, before)
        entry = contact_projector(system, row.t, rest, now) @ entry @ matrix
    out = jnp.where(last, entry, out)
    return jnp.where(taken, out, jnp.eye(n))


def _across(system, row: LogRow, before, held, now, law_of, planar):
    side = row.constraint
    field_before = field_of(system, None if planar else held)
    field_after = field_of(system, None if planar else now)
    law_x, moved, normal, speed = event_crossing(
        law_of(system, side),
        gap_of(system, side),
        field_before,
        field_after,
        row.t,
        before,
    )
    return law_x + moved[:, None] * (normal / speed)[None, :]


def elementwise_product(a, b):
    """Multiply matrices by elementwise operations, for batches."""
    return jnp.sum(a[:, :, None] * b[None, :, :], axis=1)
