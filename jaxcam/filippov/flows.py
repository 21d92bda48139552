"""Run the event loop with or without a record, or integrate a single mode."""

import equinox as eqx
import equinox.internal as eqxi
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from ..hybrid.lowering import while_loop
from ._step import attempt, DONE, FilippovState, in_mode, RUNNING
from ._system import FilippovSystem
from .modes import first_mode


CHUNK = 256
"""Number of attempts between two checks from Python."""


def first_filippov_state(system: FilippovSystem, state, t0, t1) -> FilippovState:
    whole = t1 - t0
    step = jax.lax.stop_gradient(whole / 64)
    zero = jnp.zeros_like(t0)
    return FilippovState(
        t0, state, first_mode(system, t0, state), step, step, zero, zero + RUNNING
    )


@eqx.filter_jit
def start(system, state, t0, t1) -> FilippovState:
    return first_filippov_state(system, state, t0, t1)


@eqx.filter_jit
def chunk(system, tolerance, t1, carried: FilippovState):
    """Run many attempts, recording a row for each."""

    def one(carried, _):
        return attempt(system, tolerance, t1, carried)

    return jax.lax.scan(one, carried, length=CHUNK)


def filippov_flow(
    system: FilippovSystem,
    state: Float[Array, " n"],
    t0,
    t1,
    *,
    tolerance=1e-10,
    max_steps: int = 100_000,
) -> Float[Array, " n"]:
    """Return the state at `t1` of the motion that starts at `state`; for use inside
    `jit`.

    It can be batched, and differentiated with respect to state, times and parameters,
    including the effects of crossing the surface and of entering and leaving sliding.

    Args:
        system: The system.
        state: Initial state, shape `(n,)`.
        t0: Start time (s).
        t1: End time (s).
        tolerance: Relative error allowed per step.
        max_steps: Maximum number of attempted integration steps.

    Returns:
        The state, shape `(n,)`; NaN if `t1` is not reached within `max_steps` attempted
            steps.

    Examples:
        >>> from jaxcam.filippov import filippov_flow
        >>> from jaxcam.models import BeltOscillator
        >>> filippov_flow(BeltOscillator(), jnp.array([1.0, 0.0]), 0.0, 1.0).shape
        (2,)
    """
    t0, t1 = jnp.asarray(t0, dtype=float), jnp.asarray(t1, dtype=float)
    carried = first_filippov_state(system, state, t0, t1)
    carried = jax.tree.map(jnp.asarray, carried)

    def running(carry):
        carried, count = carry
        return (count < max_steps) & eqxi.unvmap_any(carried.status == RUNNING)

    def one(carry):
        carried, count = carry
        return attempt(system, tolerance, t1, carried)[0], count + 1

    carried, _ = while_loop(running, one, (carried, 0))
    return jnp.where(carried.status == DONE, carried.x, jnp.nan)


def leg_flow(
    system: FilippovSystem,
    mode,
    state: Float[Array, " n"],
    t0,
    t1,
    steps: int = 64,
) -> Float[Array, " n"]:
    """Integrate one mode from `t0` to `t1` in equal steps, without events.

    The result is differentiable; saltation and monodromy matrices are computed with it.

    Args:
        system: The system.
        mode: 1 above the surface, -1 below it, 0 sliding on it.
        state: State, shape `(n,)`.
        t0: Start time (s).
        t1: End time (s).
        steps: Number of steps.

    Returns:
        State at `t1`, shape `(n,)`.
    """
    h = (t1 - t0) / steps

    def one(k, x):
        return in_mode(system, mode, t0 + k * h, x, h)[0]

    return jax.lax.fori_loop(0, steps, one, state)
