"""Find whether the field `phase` of a system is the phase of its forcing."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ...hybrid import HybridSystem


# Times, in periods, and changes of the phase (rad) at which the functions of a system
# are compared
_TIMES = (0.13, 0.61)
_CHANGE = 0.7
# Relative difference up to which two values are equal
_ROUNDING = 1e-9


def phase_sense(system: HybridSystem, coordinates) -> int:
    """Return s = 1 or -1 if the forcing depends on the time and on the field `phase`
    (rad) through `2 pi t / period + s phase` alone; otherwise 0.

    **Arguments:** the system, and the state components of its coordinates and
    velocities.
    """
    if not hasattr(system, "phase") or system.period is None:
        return 0
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(system)):
        return 0
    least = 1 + max(max(pair) for pair in coordinates)
    state = 0.1 * jnp.arange(1.0, max(least, len(system.state_names)) + 1)
    period = float(system.period)

    def shifted(change: float) -> HybridSystem:
        phase = jnp.asarray(system.phase, dtype=float)  # pyright: ignore
        return eqx.tree_at(lambda s: s.phase, system, phase + change)

    def values(one: HybridSystem, time: float) -> np.ndarray:
        t = jnp.asarray(time)
        parts = one.vector_field(t, state), one.gap(t, state), one.impact(t, state)
        return np.concatenate([np.ravel(part) for part in parts])

    times = [period * part for part in _TIMES]
    here = [values(shifted(0.0), t) for t in times]
    there = [values(shifted(_CHANGE), t) for t in times]
    if _close(here, there):
        return 0
    later = period * _CHANGE / (2 * np.pi)
    for sense in (1, -1):
        moved = [values(shifted(0.0), t + sense * later) for t in times]
        if _close(moved, there):
            return sense
    return 0


def _close(some: list[np.ndarray], others: list[np.ndarray]) -> bool:
    return bool(np.allclose(some, others, rtol=_ROUNDING, atol=1e-12))
