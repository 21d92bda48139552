"""Run batch elements together with an orthonormal frame of tangent vectors."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

from ..backend import Rowwise
from ..loop import first_state, Functions, iteration, Jet, LoopState, Plan
from ._layout import Horizon, Lanes, start_lanes
from ._refilled_lanes import run_compiled
from ._table import Table


# a tangent vector that shrinks to this fraction in one attempt has vanished: what is
# left of it is a rounding error
_GONE = 1e-14
# number of batch elements whose starts are computed at a time
_WIDTH = 128


class Varying(NamedTuple):
    """The parts of a loop state that have derivatives at a fixed time; all other parts
    have none.
    """

    x: tuple
    jets: tuple
    step: Any

    @staticmethod
    def of(state: LoopState) -> "Varying":
        """Return the parts of a loop state that have derivatives."""
        return Varying(state.x, state.jets, state.step)

    def put(self, state: LoopState) -> LoopState:
        """Return a loop state with its parts replaced by these."""
        return state._replace(**self._asdict())


class TangentState(NamedTuple):
    """The loop state, the tangent vectors, and the logarithms of their growth.

    The parts of the tangent vectors that belong to the state `x` are orthonormal.
    """

    state: LoopState
    frame: tuple[Varying, ...]
    logs: tuple


def tangent_iteration(functions: Functions, plan: Plan, carried: TangentState):
    """Take one attempted step, with its derivative.

    The frame is orthonormalised after each attempt; the product of the triangular
    factors of all attempts is the factor of the whole motion.
    """

    def attempt(varying: Varying):
        after, record = iteration(functions, plan, varying.put(carried.state))
        return (after.t, Varying.of(after)), (after, record)

    def along(tangent: Varying):
        given = (Varying.of(carried.state),), (tangent,)
        return jax.jvp(attempt, *given, has_aux=True)

    stacked = jax.tree.map(lambda *parts: jnp.stack(parts), *carried.frame)
    mapped = jax.vmap(along, out_axes=(None, 0, None))
    _, (delays, tangents), (after, record) = mapped(stacked)
    rates = functions.field(after.t, after.x, after.mode)
    columns = []
    for k in range(len(carried.logs)):
        column = jax.tree.map(lambda leaf, k=k: leaf[k], tangents)
        columns.append(_at_one_time(functions, after, rates, delays[k], column))
    columns, growth = _orthonormal(columns)
    logs = tuple(
        total + jnp.log(grown)
        for total, grown in zip(carried.logs, growth, strict=True)
    )
    return TangentState(after, tuple(columns), logs), record


def _at_one_time(
    functions, state: LoopState, rates, delay, tangent: Varying
) -> Varying:
    """Return the tangent vector between motions at the same time, from the `tangent`
    between motions whose attempts end at times that differ by the `delay`.
    """
    x = [d - rate * delay for d, rate in zip(tangent.x, rates, strict=True)]
    # the rate of the jerk is not known; no derivative of an event depends on it
    jets = [
        Jet(
            d.gap - jet.velocity * delay,
            d.velocity - jet.acceleration * delay,
            d.acceleration - jet.jerk * delay,
            d.jerk,
        )
        for d, jet in zip(tangent.jets, state.jets, strict=True)
    ]
    # the next step is longer by the delay if it ends at an event
    fixed = state.completing | state.locating
    step = tangent.step + jnp.where(fixed, delay, 0.0)
    moved = Varying(tuple(x), tuple(jets), step)
    if not functions.planar:
        return moved
    # in contact, time alone determines the state
    (held,) = state.contact
    return jax.tree.map(lambda part: jnp.where(held, 0.0, part), moved)


def _orthonormal(columns: list[Varying]):
    """Return columns orthonormalised with respect to the state, and their lengths."""
    done, lengths = [], []
    for column in columns:
        before = _product(column, column)
        # two passes make the columns orthogonal to within rounding
        for _ in range(2):
            for earlier in done:
                share = _product(earlier, column)
                column = jax.tree.map(lambda a, b, c=share: a - c * b, column, earlier)
        square = _product(column, column)
        gone = square <= _GONE * _GONE * jnp.maximum(before, 1.0)
        length = jnp.where(gone, 0.0, jnp.sqrt(jnp.where(gone, 1.0, square)))
        inverse = jnp.where(gone, 0.0, 1.0) / jnp.where(gone, 1.0, length)
        done.append(jax.tree.map(lambda a, c=inverse: a * c, column))
        lengths.append(length)
    return done, lengths


def _product(a: Varying, b: Varying):
    return sum(first * second for first, second in zip(a.x, b.x, strict=True))


def _first_of(shared, row) -> TangentState:
    """Return the first loop state and the first frame of one batch element."""
    (t0, rest), (own, state) = shared, row
    system, plan = eqx.combine(own, rest)
    functions = Functions(system, state.shape[0], plan.plain, shared=True)
    limits = plan.t1, plan.longest_step, plan.repeat

    def start(x):
        lane = first_state(functions, t0, tuple(x[i] for i in range(len(x))), *limits)
        lane = jax.tree.map(jnp.asarray, lane)
        return Varying.of(lane), lane

    def along(direction):
        return jax.jvp(start, (state,), (direction,), has_aux=True)

    n = state.shape[0]
    mapped = jax.vmap(along, out_axes=(None, 0, None))
    _, tangents, lane = mapped(jnp.eye(n))
    frame = tuple(jax.tree.map(lambda leaf, k=k: leaf[k], tangents) for k in range(n))
    return TangentState(lane, frame, (jnp.zeros(()),) * n)


_FIRST = Rowwise(_first_of)


def run_tangents(
    lanes: Lanes, horizon: Horizon, settings, max_steps: int, table: Table, between=None
):
    """Run the batch elements, each with a frame of tangent vectors.

    The row of the `table` is a function of the record of an attempt and of the
    `TangentState` after it. `between` is called at intervals.

    Returns:
        Impacts, attempts and result codes, each `(elements,)`.

    **Raises:** `Lacking` if the LLVM backend lacks an operation.
    """
    start = start_lanes(lanes, horizon, settings, _WIDTH, _FIRST)
    return run_compiled(
        start, max_steps, table, step=tangent_iteration, between=between
    )
