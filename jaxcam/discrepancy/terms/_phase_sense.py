"""Find whether the field `phase` of a system is the phase of its forcing."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer

from ...hybrid import HybridSystem, SwitchedSystem


# Times, in periods, and changes of the phase (rad) at which the functions of a system
# are compared
_TIMES = (0.13, 0.61)
_CHANGE = 0.7
# Relative difference up to which two values are equal
_ROUNDING = 1e-9


def phase_sense(system: HybridSystem, state) -> int:
    """Return s = 1 or -1 if the forcing depends on the time and on the field `phase`
    (rad) through `2 pi t / period + s phase` alone; otherwise 0.

    **Arguments:** the system, and a state at which its functions can be evaluated.
    """
    if not _has_phase(system) or system.period is None:
        return 0
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves(system)):
        return 0
    state, period = jnp.asarray(state, dtype=float), float(system.period)

    def shifted(change: float) -> HybridSystem:
        phase = jnp.asarray(system.phase, dtype=float)  # pyright: ignore
        return eqx.tree_at(lambda s: s.phase, system, phase + change)

    def values(one: HybridSystem, time: float) -> np.ndarray:
        t = jnp.asarray(time)
        parts = [one.vector_field(t, state), one.gap(t, state), one.impact(t, state)]
        if isinstance(one, SwitchedSystem):
            parts.append(one.switching(t, state))
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


def _has_phase(system: HybridSystem) -> bool:
    """Return whether `phase` is a field with a real number that may be fitted."""
    fields = {field.name: field for field in dataclasses.fields(system)}
    field = fields.get("phase")
    if field is None or field.metadata.get("static", False):
        return False
    phase = system.phase  # pyright: ignore
    number = isinstance(phase, (float, np.ndarray, np.floating, jax.Array))
    return number and np.shape(phase) == () and jnp.isrealobj(phase)


def _close(some: list[np.ndarray], others: list[np.ndarray]) -> bool:
    return bool(np.allclose(some, others, rtol=_ROUNDING, atol=1e-12, equal_nan=True))
