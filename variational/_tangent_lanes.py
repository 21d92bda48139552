"""Propagate frames of tangent vectors along many motions, chunk by chunk."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid.codes import RowKind
from jaxcam.hybrid.loop import first_state, Functions, Plan, run_raw

from ._event_law import completed_law
from ._step_matrix import elementwise_product, LogRow, step_matrix, StepStart


class Carried(NamedTuple):
    """The state that a motion carries from one chunk of rows to the next."""

    lane: Any
    point: StepStart
    frame: Float[Array, "n n"]
    logs: Float[Array, " n"]


# rows of the log between two checks from Python
ROWS = 256
# the widest vectors of the machine, which XLA avoids by default
_WIDE: dict[str, Any] = {"compiler_options": {"xla_cpu_prefer_vector_width": 512}}


def _plan(system, length, t0, turns, settings) -> Plan:
    length = system.period if length is None else length
    end = t0 + turns * length
    # shorter in contact, where the tangent is propagated together with the state
    plan = Plan.of(system, settings, t0, end, period=length, stop_period=length)
    return plan._replace(longest_step=jnp.minimum(plan.longest_step, length / 8))


@eqx.filter_jit
def first_frames(batched, shared, length, states, t0, turns, settings):
    """Return the initial frame of each motion."""

    def one(batched, state):
        system = eqx.combine(batched, shared).prepared()
        x = tuple(state[i] for i in range(state.shape[0]))
        plan = _plan(system, length, t0, turns, settings)
        functions = Functions(system, len(x), settings.plain)
        limits = plan.t1, plan.longest_step, plan.repeat
        lane = first_state(functions, t0, x, *limits)
        lane = jax.tree.map(jnp.asarray, lane)
        point = StepStart(lane.t, lane.x, lane.contact)
        n = len(x)
        return Carried(lane, point, jnp.eye(n), jnp.zeros(n))

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, states)


def _row(record, _):
    head = [record.kind, record.constraint, record.t]
    flags = [jnp.asarray(c, dtype=jnp.float64) for c in record.mode]
    return [jnp.asarray(v) for v in (*head, *record.before, *record.after, *flags)]


@eqx.filter_jit(**_WIDE)
def next_rows(batched, shared, length, t0, turns, settings, carry: Carried):
    """Run the next `ROWS` attempts; return the carried state and the rows of the log.

    Rows are kinds, sums of the logarithms of growth `(rows, n)`, and states.
    """

    def one(batched, carry):
        system = eqx.combine(batched, shared).prepared()
        n = len(carry.lane.x)
        functions = Functions(system, n, settings.plain)
        plan = _plan(system, length, t0, turns, settings)
        lane, log = run_raw(functions, plan, carry.lane, ROWS, _row)
        kind, side, t = log[:, 0], log[:, 1].astype(jnp.int32), log[:, 2]
        before, after = log[:, 3 : 3 + n], log[:, 3 + n : 3 + 2 * n]
        contact = log[:, 3 + 2 * n :] > 0.5
        taken = kind != float(RowKind.NOTHING)
        started = after
        if not functions.planar:
            # the motion after a chatter sequence starts with zero normal velocity
            rest = jax.vmap(lambda s, y, k: completed_law(system, k)(s, y))
            at_rest = (kind == float(RowKind.LAST_IMPACT))[:, None]
            started = jnp.where(at_rest, rest(t, before, side), after)

        def first_and(old, new):
            return jnp.concatenate([jnp.asarray(old)[None], new])

        # the latest row used, counted from the row before the first
        latest = jax.lax.cummax(jnp.where(taken, jnp.arange(1, kind.shape[0] + 1), 0))
        previous = jnp.concatenate([jnp.zeros_like(latest[:1]), latest[:-1]])
        times = first_and(carry.point.t, t)
        states = first_and(jnp.stack(carry.point.x), started)
        flags = first_and(jnp.stack(carry.point.contact), contact)

        def point_at(k):
            return StepStart(times[k], tuple(states[k].T), tuple(flags[k].T))

        rows = LogRow(kind, side, t, tuple(before.T), tuple(after.T), tuple(contact.T))
        matrices = jax.vmap(
            lambda p, r: step_matrix(system, functions, plan.tableau, p, r)
        )(point_at(previous), rows)

        def extend(carry, matrix):
            frame, logs = carry
            frame, growth = orthonormal(elementwise_product(matrix, frame))
            logs = logs + jnp.log(growth)
            return (frame, logs), logs

        (frame, logs), sums = jax.lax.scan(extend, (carry.frame, carry.logs), matrices)
        at = point_at(latest[-1])
        return Carried(lane, at, frame, logs), (kind, sums, after)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, carry)


def orthonormal(matrix: Float[Array, "n n"]):
    """Orthonormalise columns (Gram-Schmidt); return them and the previous lengths.

    A column of zeros remains zero.
    """
    columns, lengths = [], []
    for k in range(matrix.shape[0]):
        column = matrix[:, k]
        # two passes are enough
        for _ in range(2):
            for earlier in columns:
                column = column - jnp.sum(earlier * column) * earlier
        length = jnp.sqrt(jnp.sum(column * column))
        columns.append(column / jnp.where(length > 0, length, 1.0))
        lengths.append(length)
    return jnp.stack(columns, axis=1), jnp.stack(lengths)
