"""Simulate a Filippov system and locate all switches."""

import jax
import jax.numpy as jnp
import numpy as np

from ..hybrid.checks import refuse_tracers
from ..parameters import as_arrays, real_array, VectorLike
from ._step import EVENT, NOT_FINITE, NOTHING, RUNNING
from ._system import FilippovSystem
from ._trajectory import FilippovTrajectory, Switches
from .flows import CHUNK, chunk, start
from .modes import region


_WHY = {
    RUNNING: "The maximum number of steps was reached before t1: raise max_steps.",
    2: (
        "No step was short enough: a vector field or the surface is not smooth here, "
        "or the tolerance is below the rounding error."
    ),
    NOT_FINITE: "A vector field returned NaN or infinity: check parameters and state.",
}


def simulate_filippov(
    system: FilippovSystem,
    state: VectorLike,
    t0,
    t1,
    *,
    tolerance: float = 1e-10,
    max_steps: int = 1_000_000,
) -> FilippovTrajectory:
    """Simulate a Filippov system from `t0` to `t1`.

    Switches are located with the accuracy of the steps; switches within a step are
    detected by a cubic in time. At the surface, the motion crosses, or slides according
    to Filippov's convex combination until one field becomes tangent.

    Args:
        system: The system.
        state: Initial state, shape `(n,)`.
        t0: Start time (s).
        t1: End time (s).
        tolerance: Relative error allowed per step.
        max_steps: Maximum number of attempted integration steps.

    Returns:
        A [`jaxcam.filippov.FilippovTrajectory`][].

    Raises:
        ValueError: The start is not finite, or is on a part of the surface from which
            both fields point away, where the motion is not unique.

    Examples:
        >>> from jaxcam.filippov import simulate_filippov
        >>> from jaxcam.models import BeltOscillator
        >>> run = simulate_filippov(BeltOscillator(), [1.0, 0.0], 0.0, 1.0)
        >>> run.final.shape
        (2,)
    """
    refuse_tracers(
        "simulate_filippov", "jaxcam.filippov.filippov_flow", system, state, t0, t1
    )
    system = as_arrays(system)
    state = real_array(state)
    t0, t1 = jnp.asarray(t0, dtype=jnp.float64), jnp.asarray(t1, dtype=jnp.float64)
    _check(system, state, t0, t1)
    error = jnp.asarray(tolerance, dtype=jnp.float64)
    carried = start(system, state, t0, t1)
    rows, used = [], 0
    first = float(carried.mode)
    while int(carried.status) == RUNNING and used < max_steps:
        carried, found = chunk(system, error, t1, carried)
        rows.append(jax.tree.map(np.asarray, found))
        used += CHUNK
    kind, time, states, mode, _ = (
        np.concatenate(parts) for parts in zip(*rows, strict=True)
    )
    real = kind != NOTHING
    time = np.append(float(t0), time[real])
    states = np.concatenate([np.asarray(state)[None], states[real]])
    mode = np.append(first, mode[real]).astype(int)
    event = np.flatnonzero(kind[real] == EVENT)
    return FilippovTrajectory(
        system,
        t0,
        t1,
        jnp.asarray(time),
        jnp.asarray(states),
        jnp.asarray(mode),
        Switches(
            jnp.asarray(time[event + 1]),
            jnp.asarray(states[event + 1]),
            jnp.asarray(mode[event]),
            jnp.asarray(mode[event + 1]),
        ),
        _WHY.get(int(carried.status), ""),
    )


def _check(system, state, t0, t1):
    system.check()
    if state.ndim != 1 or not bool(jnp.all(jnp.isfinite(state))):
        raise ValueError("Give the state as one vector of finite numbers.")
    if not (
        bool(jnp.isfinite(t0)) and bool(jnp.isfinite(t1)) and float(t1) > float(t0)
    ):
        raise ValueError("Give finite times with `t1` after `t0`.")
    height = abs(float(system.switching(t0, state)))
    if height <= 1e-12 and region(system, t0, state) == "escaping":
        raise ValueError(
            "Both vector fields point away from the surface at the initial state, so "
            "the motion is not unique; start on one side of the surface."
        )
