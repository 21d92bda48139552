"""Solve the normal equations of a chain of pieces: first the states, then the
parameters.

Each state of a recording is coupled only to its neighbours, so the states are
eliminated from the first to the last with matrices of the size of one state
(block-tridiagonal elimination). The result is the reduced information of the
parameters, the Schur complement; the states follow by back substitution.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ...hybrid.programs import program
from ._linearise import Blocks


# Regularisation of the states, as a fraction of their own information
LEAST = 1e-13


class Reduced(NamedTuple):
    """Normal equations of the parameters with the states eliminated.

    For each recording: `information` `(m, m)`, `score` `(m,)`; `gain`
    `(k, n, m + 1 + n)` expresses each state in terms of the parameters, a constant, and
    the next state.
    """

    information: Float[Array, "r m m"]
    """Information of the parameters of each recording, shape `(r, m, m)`."""
    score: Float[Array, "r m"]
    """Score of the parameters of each recording, shape `(r, m)`."""
    gain: Float[Array, "r k n c"]
    """Coefficients that express each state by the parameters, a constant and the next
    state, shape `(r, k, n, m + 1 + n)`.
    """


@program
def eliminate_states(blocks: Blocks, least: float | Array = LEAST) -> Reduced:
    """Eliminate the states of every recording by a block-tridiagonal Schur complement.

    The example continues the one in [`jaxcam.fitting.engine.assemble`][].

    Args:
        blocks: The normal equations.
        least: Regularisation of each state, as a fraction of its own information.

    Returns:
        A [`jaxcam.fitting.engine.Reduced`][].

    Examples:
        >>> from jaxcam.fitting.engine import eliminate_states, prior_information
        >>> reduced = eliminate_states(blocks)
        >>> prior = prior_information(problem, columns, prior=True)[0]
        >>> information = float(reduced.information[0, 0, 0]) + prior
        >>> stderr = columns.scale[0] / information**0.5
        >>> bool(np.isclose(stderr, found.estimates[0].stderr))
        True
    """
    return jax.vmap(lambda one: _eliminate(one, least))(blocks)


@program
def state_steps(reduced: Reduced, change: Float[Array, "r m"]) -> Float[Array, "r k n"]:
    """Return the steps of the states that correspond to a step of the parameters.

    The example continues the one in [`jaxcam.fitting.engine.eliminate_states`][].

    Args:
        reduced: The reduced equations.
        change: Step of the parameters, shape `(r, m)`.

    Returns:
        Steps, shape `(r, k, n)`, in the scales of the states.

    Examples:
        >>> from jaxcam.fitting.engine import state_steps
        >>> steps = state_steps(reduced, jnp.asarray(columns.scales))  # g + 1 m/s^2
        >>> np.asarray(steps[0, 0]).round(3).tolist()  # first height and velocity
        [-0.006, 0.227]
    """

    def record(gain, change):
        size = gain.shape[-2]

        def backwards(later, gain):
            fixed = gain[:, : change.shape[0]] @ change + gain[:, change.shape[0]]
            here = fixed + gain[:, change.shape[0] + 1 :] @ later
            return here, here

        return jax.lax.scan(backwards, jnp.zeros(size), gain, reverse=True)[1]

    return jax.vmap(record)(reduced.gain, change)


def _eliminate(blocks: Blocks, part):
    size, width = blocks.sp.shape[1:]

    def forwards(carry, inputs):
        # the previous pieces contribute to the information of this piece's state
        # (`ss`), to its coupling with the parameters (`sp`) and to its score (`s`); the
        # last two are the information and score of the parameters so far
        ss, sp, s, information, score = carry
        here_ss, here_sp, here_s, after = inputs
        # a state without information gets a unit diagonal, so that it does not move
        diagonal = jnp.diagonal(here_ss)
        least = jnp.where(diagonal > 0, part * diagonal, 1.0)
        matrix = here_ss + ss + jnp.diag(least)
        coupled = jnp.concatenate(
            [here_sp + sp, -(here_s + s)[:, None], after.T], axis=1
        )
        solved = _solve(matrix, coupled)
        by_p, by_one, by_next = (
            solved[:, :width],
            solved[:, width],
            solved[:, width + 1 :],
        )
        information = information - (here_sp + sp).T @ by_p
        score = score + (here_sp + sp).T @ by_one
        carry = (
            -after @ by_next,
            -after @ by_p,
            after @ by_one,
            information,
            score,
        )
        return carry, -solved

    start = (
        jnp.zeros((size, size)),
        jnp.zeros((size, width)),
        jnp.zeros(size),
        blocks.pp,
        blocks.p,
    )
    # the coupling is stored with the later piece, but needed at the earlier one
    after = jnp.concatenate([blocks.before[1:], jnp.zeros_like(blocks.before[:1])])
    inputs = (blocks.ss, blocks.sp, blocks.s, after)
    carry, gain = jax.lax.scan(forwards, start, inputs)
    return Reduced(carry[3], carry[4], gain)


def _solve(matrix, right):
    """Solve a positive definite system, scaled to a unit diagonal since states have
    different units.
    """
    scale = 1 / jnp.sqrt(jnp.diagonal(matrix))
    scaled = matrix * jnp.outer(scale, scale)
    if matrix.shape[0] == 2:
        # a LAPACK call for each matrix would take longer than everything else
        b = scaled[0, 1]
        det = 1 - b * b
        x, y = right[0] * scale[0], right[1] * scale[1]
        return jnp.stack([(x - b * y) / det * scale[0], (y - b * x) / det * scale[1]])
    factor = jax.scipy.linalg.cho_factor(scaled, lower=True)
    return jax.scipy.linalg.cho_solve(factor, right * scale[:, None]) * scale[:, None]
