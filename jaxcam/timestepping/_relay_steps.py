"""Backward Euler steps of a relay system (thesis, eqs. 3.2-3.4)."""

from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..hybrid.programs import program
from ..parameters import real_array, VectorLike
from ._chunks import CHUNK, in_chunks
from .complementarity import explain
from .relay import is_p_matrix, relay_problem, RelaySystem


class RelayMotion(NamedTuple):
    """Motion of a relay system, sampled at the ends of the time steps; the first row is
    the initial state.
    """

    time: Float[Array, " times"]
    """Times (s), shape `(steps + 1,)`."""
    state: Float[Array, "times n"]
    """States, shape `(steps + 1, n)`."""
    inputs: Float[Array, "steps m"]
    """Inputs u in each step, shape `(steps, m)`."""
    outputs: Float[Array, "steps m"]
    """Outputs y in each step, shape `(steps, m)`."""


def relay_steps(
    system: RelaySystem,
    state: VectorLike,
    t1,
    steps: int,
    *,
    progress: Callable[[float], None] | None = None,
) -> RelayMotion:
    """Simulate a relay system from time zero to `t1` in `steps` backward Euler steps.

    Switching times are not located, and sliding requires no special handling:
    infinitely many events in finite time take no more computing time than none. The
    error is of first order in the step length (M. K. Camlibel, W. P. M. H. Heemels, J.
    M. Schumacher, Consistency of a time-stepping method for a class of piecewise-linear
    networks, 2002).

    Args:
        system: The system.
        state: Initial state, shape `(n,)`.
        t1: End time (s).
        steps: Number of steps.
        progress: Called with the fraction of steps completed.

    Returns:
        A `RelayMotion`.

    Raises:
        ValueError: A step has no solution or more than one: I - h A is singular, or C
            (I/h - A)^-1 B + D is not a P-matrix.

    Examples:
        >>> from jaxcam.timestepping import RelaySystem, relay_steps
        >>> system = RelaySystem([[-1.0]], [[1.0]], [[1.0]])
        >>> relay_steps(system, [1.0], 1.0, 50).state.shape
        (51, 1)
    """
    state = real_array(state)
    n = system.A.shape[0]
    if state.shape != (n,):
        raise ValueError(f"Give a state of shape {(n,)}; it has shape {state.shape}.")
    if not (steps >= 1 and float(t1) > 0):
        raise ValueError("Give a `t1` after zero and at least one step.")
    h = jnp.asarray(float(t1) / steps)
    matrix = np.eye(n) - float(h) * np.asarray(system.A)
    if not np.linalg.cond(matrix) < 1e12:
        raise ValueError(
            "I - h A cannot be inverted for this step; change the number of steps."
        )
    one_step = _one_step(system, h)[2]
    if not is_p_matrix(one_step):
        raise ValueError(
            "A step of this relay system has more than one solution: C (I/h - A)^-1 B "
            "+ D is not a P-matrix; change the signs of B or C, or use shorter steps."
        )
    states, inputs, outputs, codes = in_chunks(
        lambda x, _: _run(system, x, h), state, steps, progress
    )
    worst = int(jnp.max(codes))
    explain(worst, f" of step {int(jnp.argmax(codes > 0))}")
    times = jnp.asarray(np.linspace(0.0, float(t1), steps + 1))
    states = jnp.concatenate([state[None], states])
    return RelayMotion(times, states, inputs, outputs)


def _one_step(system, h):
    n = system.A.shape[0]
    inverse = jnp.linalg.inv(jnp.eye(n) - h * system.A)
    forced = h * inverse @ system.B
    return inverse, forced, system.C @ forced + system.D


@program
def _run(system, state, h):
    inverse, forced, matrix = _one_step(system, h)

    def step(x, _):
        free = inverse @ x
        u, y, found = relay_problem(matrix, system.C @ free)
        x = free + forced @ u
        return x, (x, u, y, found.code)

    return jax.lax.scan(step, state, length=CHUNK)
