"""Propagate tangent vectors by the derivative of the flow over each period."""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxcam.hybrid import flow
from jaxcam.hybrid.programs import program


# if orthogonalisation shortens a vector to less than this fraction of its length, the
# rest is rounding error
_HIDDEN = 1e-12
# number of periods run in one call from Python
TURNS = 16


class TurnFrame(NamedTuple):
    """The state of one motion at the start of a period."""

    state: Float[Array, " n"]
    frame: Float[Array, "n n"]
    # sums of the logarithms of growth, and number of impacts so far
    logs: Float[Array, " n"]
    impacts: Float[Array, ""]
    turn: Float[Array, ""]
    # the first code other than success
    code: Array


def first_turn(states: Float[Array, "lanes n"]) -> TurnFrame:
    """Return the start of the first period of each motion."""
    lanes, n = states.shape
    none = jnp.zeros(lanes)
    frames = jnp.broadcast_to(jnp.eye(n), (lanes, n, n))
    code = jnp.zeros(lanes, dtype=jnp.int32)
    return TurnFrame(states, frames, jnp.zeros((lanes, n)), none, none, code)


@program
def next_turns(batched, shared, length, begin, settings, max_steps, carry: TurnFrame):
    """Run the next `TURNS` periods; return the carried state, and its values at the end
    of each period, `(motions, TURNS, ...)`.

    **Arguments:** `max_steps` limits the attempted steps in a period.
    """

    def one(batched, carry):
        system = eqx.combine(batched, shared)
        span = system.period if length is None else length

        def turn(carry: TurnFrame, _):
            t = begin + carry.turn * span

            def end(x):
                made = flow(
                    system, x, t, t + span, settings=settings, max_steps=max_steps
                )
                return made.state, made

            matrix, made = jax.jacfwd(end, has_aux=True)(carry.state)
            columns = elementwise_product(matrix, carry.frame)
            frame, growth = orthonormal(columns)
            # what orthogonalisation leaves of a column may be only rounding error
            before = jnp.sqrt(jnp.sum(columns * columns, axis=0))
            hidden = (growth > 0) & (growth < _HIDDEN * before)
            growth = jnp.where(hidden, jnp.nan, growth)
            after = TurnFrame(
                made.state,
                frame,
                carry.logs + jnp.log(growth),
                carry.impacts + made.impacts,
                carry.turn + 1,
                jnp.where(carry.code == 0, made.code, carry.code),
            )
            return after, after

        return jax.lax.scan(turn, carry, None, length=TURNS)

    return eqx.filter_vmap(one, in_axes=(eqx.if_array(0), 0))(batched, carry)


def elementwise_product(a, b):
    """Return the matrix product a b, computed by elementwise operations for batches."""
    return jnp.sum(a[:, :, None] * b[None, :, :], axis=1)


def orthonormal(matrix: Float[Array, "n n"]):
    """Orthonormalise columns (Gram-Schmidt); also return their lengths before scaling.

    A column of zeros remains zero.
    """
    columns, lengths = [], []
    for k in range(matrix.shape[0]):
        column = matrix[:, k]
        # two passes make the columns orthogonal to within rounding
        for _ in range(2):
            for earlier in columns:
                column = column - jnp.sum(earlier * column) * earlier
        length = jnp.sqrt(jnp.sum(column * column))
        columns.append(column / jnp.where(length > 0, length, 1.0))
        lengths.append(length)
    return jnp.stack(columns, axis=1), jnp.stack(lengths)
