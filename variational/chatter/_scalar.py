"""Handle scalar gaps and gap vectors of length one of single-constraint systems."""

import jax.numpy as jnp

from jaxcam import HybridSystem


def one_constraint(value, ndim: int):
    """Return `value` without its axis of constraints, if it has one."""
    return jnp.reshape(value, value.shape[-ndim:] if ndim else ())


def check_chatter_system(system: HybridSystem) -> None:
    """Raise `ValueError` for a system without the period that chattering theory
    needs.
    """
    if system.period is None:
        raise ValueError(
            "this system has no forcing period; chattering that ends at a release "
            "needs one"
        )


def scalar_gap(system: HybridSystem, time, state):
    """Return the gap of a system with one constraint, a scalar."""
    return one_constraint(system.gap(time, state), 0)
