"""Fit the model to windows of a recording, each with an initial state of its own."""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from ...hybrid.programs import program
from ...hybrid.runge_kutta import array_step, RK4
from ...hybrid.surface import gaps
from ..engine import DriveState, Layout, Model
from ._record import readings_of, Record


# Number of windows that one call fits; the last call is padded
_ROWS = 128
# Iterations of Gauss-Newton; a linear system needs one. The parameters are held in the
# first ones, because an initial state estimated from differences of samples is inexact
_ITERATIONS, _HELD = 4, 2
# Information on a component of the state, relative to the largest, below which the
# samples of a window do not determine it
_BLIND = 1e-10

Window: TypeAlias = tuple[int, int]
"""The first sample of a window, and one past its last."""


class Flights(NamedTuple):
    """Fits of `b` windows of at most `w` samples, with `p` parameters in units of their
    sizes.

    - `first`: sample at which the prediction begins, `(b,)`.
    - `cost`: sum of squared residuals in standard errors, with the cost of the change
        of the parameters, `(b,)`; `count`: number of readings, `(b,)`.
    - `normal`, `target`: information on the parameters, the state being eliminated,
        `(b, p, p)` and `(b, p)`.
    - `gaps`, `rates`: predicted gaps and their rates at each sample, `(b, w, g)`, and
        their standard errors; those of the gaps are due to the state alone.
    """

    first: Int[np.ndarray, " b"]
    cost: Float[np.ndarray, " b"]
    count: Int[np.ndarray, " b"]
    normal: Float[np.ndarray, "b p p"]
    target: Float[np.ndarray, "b p"]
    gaps: Float[np.ndarray, "b w g"]
    gaps_stderr: Float[np.ndarray, "b w g"]
    rates: Float[np.ndarray, "b w g"]
    rates_stderr: Float[np.ndarray, "b w g"]

    def at(self, rows) -> "Flights":
        """Return some of the windows."""
        return Flights(*(one[rows] for one in self))


class Flyer(NamedTuple):
    """A recording and the model that flies through its windows.

    `values` and `sizes` are those of the parameters, `(p,)`. A prediction covers
    `width` samples; it begins `margin` samples before its window, because two flights
    meet between their last and first samples.
    """

    layout: Layout
    record: Record
    values: Float[np.ndarray, " p"]
    sizes: Float[np.ndarray, " p"]
    width: int
    margin: int

    def fly(
        self, windows: Sequence[Window], precision: Float[np.ndarray, "p p"] | None
    ) -> Flights:
        """Fit windows.

        **Arguments:** `precision`: information on the parameters, in units of their
        sizes, with which their values are known, or `None` if each window keeps them.
        """
        held = precision is None
        known = np.zeros((len(self.values),) * 2) if precision is None else precision
        edges = np.array(windows, dtype=int).reshape(-1, 2)
        found = []
        for k in range(0, len(edges), _ROWS):
            some = edges[k : k + _ROWS]
            rows = np.concatenate([some, np.repeat(some[-1:], _ROWS - len(some), 0)])
            first = np.maximum(rows[:, 0] - self.margin, 0)
            fitted = _fit(
                self.layout,
                self.record,
                self.values,
                self.sizes,
                known,
                np.asarray(held),
                np.arange(self.width),
                first,
                rows,
            )
            parts = [np.asarray(one)[: len(some)] for one in (first, *fitted)]
            found.append(Flights(*parts))
        return Flights(*(np.concatenate(column) for column in zip(*found)))


@program
def _fit(
    layout: Layout, record: Record, values, sizes, known, held, places, first, rows
):
    values, sizes, known = (jnp.asarray(x) for x in (values, sizes, known))
    held = jnp.asarray(held)
    many = len(values)
    size = record.guess.shape[-1]

    def one(first, row):
        place = first + jnp.asarray(places)
        # samples beyond the padding are not used
        place = jnp.minimum(place, len(record.values) - 1)
        used = (place >= row[0]) & (place < row[1])
        known_here = record.known[place] & used[:, None]
        weight = jnp.where(known_here, 1.0, 0.0) / record.noise[None]
        begin = record.begin + first.astype(float) * record.interval
        drives = DriveState(*(part[place] for part in record.drive))

        def predicted(u):
            model = layout.at(values + sizes * u[size:])
            return _predicted(model, record, u[:size], begin, drives)

        def normal(u, whole):
            def both(u):
                found = predicted(u)
                return (found if whole else found[0]), found

            slopes, (shown, gap, rate) = jax.jacfwd(both, has_aux=True)(u)
            by = slopes[0] if whole else slopes
            jacobian = (by * weight[..., None]).reshape(-1, len(u))
            off = ((record.values[place] - shown) * weight).reshape(-1)
            return (
                jacobian.T @ jacobian,
                jacobian.T @ off,
                jnp.sum(off**2),
                (
                    slopes,
                    gap,
                    rate,
                ),
            )

        def step(u, matrix, target, held):
            own = _inverse(matrix[:size, :size])
            across = matrix[size:, :size] @ own
            left = matrix[size:, size:] - across @ matrix[:size, size:]
            right = target[size:] - across @ target[:size]
            change = jnp.zeros(many)
            if many:
                unit = jnp.eye(many)
                change = jnp.linalg.solve(
                    left + known + 1e-12 * unit, right - known @ u[size:]
                )
                change = jnp.where(held, 0.0, change)
            state = own @ (target[:size] - matrix[:size, size:] @ change)
            return jnp.concatenate([state, change]), own, left, right

        def iterate(number, u):
            matrix, target, _, _ = normal(u, False)
            return u + step(u, matrix, target, held | (number < _HELD))[0]

        u = jnp.concatenate([record.guess[first], jnp.zeros(many)])
        u = jax.lax.fori_loop(0, _ITERATIONS, iterate, u)
        matrix, target, cost, (slopes, gap, rate) = normal(u, True)
        _, own, left, right = step(u, matrix, target, held)
        cost = cost + u[size:] @ known @ u[size:]
        blank = jnp.zeros_like(matrix)
        alone = blank.at[:size, :size].set(own)
        # errors of the parameters move the gaps of both flights at an impact alike, but
        # not the speeds before and after it
        given = _inverse(matrix + blank.at[size:, size:].set(known))
        errors = [
            jnp.sqrt(jnp.einsum("wgi,ij,wgj->wg", by, covariance, by))
            for by, covariance in zip(
                slopes[1:], (alone, jnp.where(held, alone, given)), strict=True
            )
        ]
        count = jnp.sum(known_here)
        return cost, count, left, right, gap, errors[0], rate, errors[1]

    return jax.vmap(one)(jnp.asarray(first), jnp.asarray(rows))


def _predicted(model: Model, record: Record, state, begin, drives: DriveState):
    """Return the readings, the gaps and their rates at each sample, `(w, c)` and
    `(w, g)`, of a flight from a state at time `begin`.
    """

    def step(state, inputs):
        number, drive = inputs
        t = begin + number * record.interval
        system_at = model.during(t + record.interval / 2, drive)
        part = record.interval / record.substeps

        def field(t, x):
            return system_at(t).vector_field(t, x)

        after, _, rate = array_step(RK4, field, t, state, part)
        for k in range(1, record.substeps):
            after = array_step(RK4, field, t + k * part, after, part)[0]

        def gap(t, x):
            return gaps(system_at(t), t, x)

        along = (jnp.ones_like(t), rate)
        shown = readings_of(model, record, state, rate)
        return after, (shown, *jax.jvp(gap, (t, state), along))

    numbers = jnp.arange(drives.angle.shape[0], dtype=float)
    return jax.lax.scan(step, state, (numbers, drives))[1]


def _inverse(matrix):
    """Return the inverse of the normal matrix of a state; a component that the samples
    do not determine keeps its value.
    """
    size = jnp.diagonal(matrix)
    scale = jnp.where(size > 0, 1 / jnp.sqrt(jnp.where(size > 0, size, 1.0)), 0.0)
    scales = jnp.outer(scale, scale)
    unit = jnp.eye(len(scale))
    return jnp.linalg.inv(matrix * scales + _BLIND * unit) * scales
